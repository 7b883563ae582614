"""Ends of contact between solids: curves on the secondary, and the area that they enclose.

At a distance t from a frictionless end the pressure inside is K t^(1/2), and the gap outside is
4 K t^(3/2) / (3 E*), as in the plane. So f = p^2 / K^2 inside, -(3 E* gap / 4 K)^(2/3) outside, is
the distance from the end, with a sign. The median slope of gap^(2/3) beside the contact gives K.
Ends are the zero contour of f, which is linear between nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index, Mask, paths
from ..fem import FacetTrace, Moduli, contact_modulus
from ..problem import Problem
from ..reference import triangle
from .state import ContactState

# Distance at a node in contact without pressure: a sign alone.
INSIDE_DISTANCE = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class SignedDistance:
    """f at the q nodes of the k facets of a pair's secondary."""

    trace: FacetTrace
    segments: Index  # (k,)
    value: Array  # (k, q) lengths, positive in contact, NaN where no row tells
    name: Index  # (k, q) numbers of nodes, one for each side of an edge of the body


def signed_distance(
    problem: Problem, moduli: Moduli, trace: FacetTrace, state: ContactState
) -> SignedDistance:
    """The distance from the end of a pair's contact, positive inside it."""
    line, m, active = state.line, len(state.gap), state.active
    nodes = trace.nodes[line.segments]
    own = line.rows_at(nodes)
    name = np.where(own >= 0, own, m + nodes)
    size = trace.sizes(line.segments)

    def at_nodes(values: Array) -> Array:
        known = line.on_segments(values, np.nan)
        return with_vertices(known, line.rows < 0, name, size, within=True)

    closed = np.where(active, state.pressure**2, 0.0)
    opened = np.where(active, 0.0, np.maximum(state.gap, 0.0) ** (2 / 3))
    slope = _slope(trace, line.segments, name, at_nodes(opened), at_nodes(closed))
    sides = trace.element[line.segments], trace.element[line.facing]
    K = 0.75 * contact_modulus(problem, moduli, *sides) * slope**1.5
    if 0 < K**2 < np.inf:
        value = np.where(active, np.maximum(closed / K**2, INSIDE_DISTANCE), -opened / slope)
    else:  # nothing is open, or without a slope: ends lie midway between nodes
        value = np.where(active, 1.0, -1.0)
    return SignedDistance(trace, line.segments, at_nodes(value), name)


def with_vertices(
    values: Array, rowless: Mask, name: Index, size: Array, *, within: bool = False
) -> Array:
    """The `values` (k, q), at order 2 with means at `rowless` (k, q) vertices: (k, q).

    By area `size` (k,) of facets, of the linear functions through the middles of edges; `within`
    the range of these middles if so asked. Nodes have a `name` (k, q). A middle without a value
    has the mean of others of its facet; NaN where none is.
    """
    if values.shape[1] != len(triangle.nodes(2)):
        return values
    middles = _filled(values[:, 3:])
    k, i = np.nonzero(rowless[:, :3] & np.isfinite(middles[:, :1]))
    at, count = name[k, i], int(name.max(initial=-1)) + 1
    through = np.linalg.solve(triangle.nodes(2)[3:], middles.T).T  # values at the vertices
    with np.errstate(invalid="ignore"):  # 0 / 0 is NaN
        mean = np.bincount(at, size[k] * through[k, i], count) / np.bincount(at, size[k], count)
    if within:
        low, high = np.full(count, np.inf), np.full(count, -np.inf)
        np.minimum.at(low, at, middles[k].min(axis=1))
        np.maximum.at(high, at, middles[k].max(axis=1))
        mean = np.clip(mean, low, high)
    vertices = np.where(rowless[:, :3], mean[name[:, :3]], values[:, :3])
    return np.concatenate([vertices, values[:, 3:]], axis=1)


def _filled(values: Array) -> Array:
    """Values (k, q), for those that are NaN the means of others of the same facet, if any."""
    known = np.isfinite(values)
    count = known.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):  # 0 / 0 is NaN
        mean = np.where(known, values, 0.0).sum(axis=1, keepdims=True) / count
    return np.where(known, values, mean)


def _slope(trace: FacetTrace, segments: Index, name: Index, opened: Array, closed: Array) -> float:
    """Median slope of `opened` (k, q) beside ends of contact, where `closed` (k, q) is 0."""
    parts = triangle.parts(trace.order)
    x = trace.point(*trace.at_nodes(segments)).reshape(*name.shape, 3)
    open_part = (closed[:, parts] == 0).all(axis=2)
    ending = (closed[:, parts] > 0).any(axis=2) & (opened[:, parts] > 0).any(axis=2)
    beside = open_part & np.isin(name, name[:, parts][ending])[:, parts].any(axis=2)
    edges, rise = (v[:, parts][beside] for v in (x, opened))
    edges, rise = edges[:, 1:] - edges[:, :1], rise[:, 1:] - rise[:, :1]
    known = np.isfinite(rise).all(axis=1)
    edges, rise = edges[known], rise[known]
    gradient = np.linalg.solve(edges @ edges.transpose(0, 2, 1), rise[..., None])[..., 0]
    return float(np.sqrt(np.median((rise * gradient).sum(axis=1)))) if len(rise) else 0.0


def curves_at_ends(zone: SignedDistance) -> list[Array]:
    """Polylines (j, 3) on which contact turns from binding to non-binding, closed or not.

    Before deformation. A closed one ends where it starts; others end where the zone does.
    """
    parts, order = triangle.parts(zone.trace.order), zone.trace.order
    f = zone.value[:, parts]
    inside = f > 0
    turns = np.isfinite(f).all(axis=2) & inside.any(axis=2) & ~inside.all(axis=2)
    facet, part = np.nonzero(turns)
    if not len(facet):
        return []
    # The two sides of each part that the contour crosses.
    first, second = parts[part], np.roll(parts[part], -1, axis=1)
    one, other = (zone.value[facet[:, None], node] for node in (first, second))
    row, side = np.nonzero((one > 0) != (other > 0))
    i, j = first[row, side], second[row, side]
    a, b = zone.value[facet[row], i], zone.value[facet[row], j]
    t = (a / (a - b))[:, None]
    nodes = triangle.nodes(order)
    x = zone.trace.point(zone.segments[facet[row]], (1 - t) * nodes[i] + t * nodes[j])
    names = np.sort(np.stack([zone.name[facet[row], i], zone.name[facet[row], j]], axis=1), axis=1)
    _, at, number = np.unique(names, axis=0, return_index=True, return_inverse=True)
    return [x[at[curve]] for curve in paths(number.reshape(-1, 2), len(at))]


def area_in_contact(zone: SignedDistance, state: ContactState) -> float:
    """Area in contact of the parts that face the primary, on the secondary before deformation."""
    parts, nodes = triangle.parts(zone.trace.order), triangle.nodes(zone.trace.order)
    some = np.flatnonzero((zone.value > 0).any(axis=1))
    f = _filled(zone.value[some])[:, parts]
    share = _positive_share(f) @ np.abs(np.linalg.det(nodes[parts]))
    facets = zone.segments[some]
    s, w = triangle.gauss(2 * zone.trace.geometry_order)
    area = zone.trace.surface_element(*zone.trace.at_places(facets, s))
    size = area.reshape(len(facets), len(w)) @ w
    whole = np.ones(len(state.gap))
    covered = np.minimum(state.line.covered_shares(whole, whole)[some], 1.0)
    return float(share @ (size * covered))


def _positive_share(f: Array) -> Array:
    """Share (...) of triangles in which linear functions with values `f` (..., 3) are positive."""
    a, b, c = np.moveaxis(np.sort(f, axis=-1)[..., ::-1], -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = a**2 / ((a - b) * (a - c)), 1 - c**2 / ((c - a) * (c - b))
    return np.where(c > 0, 1.0, np.where(b > 0, two, np.where(a > 0, one, 0.0)))
