"""The pressure as a field, on lines and on surfaces."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...contact import WHOLE_SHARE, ContactState, jacobian, partners, rays, with_vertices
from ...fem import BoundaryTrace, FacetTrace
from ...quadrature import local_functions
from ...reference import triangle
from ...solved import Solved


def pressure_field(solution: Solved, state: ContactState) -> ng.GridFunction:
    """The pressure of a pair as a function on its secondary; see `Solution.pressure_field`."""
    line, trace = state.line, solution.discrete.space.trace
    boundary = solution.mesh.Boundaries(line.contact.secondary)
    if not isinstance(trace, FacetTrace):
        values, s = _at_nodes(trace, state), trace.places(line.segments)
        field = ng.GridFunction(ng.SurfaceL2(trace.mesh, order=trace.order, definedon=boundary))
        return _fitted(field, trace, line.segments, s, values)
    whole = np.ones(len(state.force))
    mean = line.covered_shares(state.force / line.weight, whole)  # over whole facets
    if trace.order == 3:
        return _mean_traction(solution, trace, state, mean)
    values = pressure_at_vertices(trace, state)
    if (line.covered_shares(whole, whole) > WHOLE_SHARE).all():  # continuous
        field = ng.GridFunction(ng.H1(solution.mesh, order=1, definedon=boundary))
        field.vec.FV().NumPy()[trace.nodes[line.segments][:, :3]] = values
        return field
    values = np.maximum(values, 0.0)
    values[~values.any(axis=1)] = 1.0
    values *= (mean / values.mean(axis=1))[:, None]
    field = ng.GridFunction(ng.SurfaceL2(trace.mesh, order=1, definedon=boundary))
    return _fitted(field, trace, line.segments, np.tile(np.eye(3), (len(values), 1)), values)


def _at_nodes(trace: BoundaryTrace, state: ContactState) -> Array:
    """Pressures (k, order + 1) at nodes; where segments face in part with the resultant of rows."""
    line, known = state.line, state.line.rows >= 0
    values = line.on_segments(state.pressure, 0.0)
    partly = np.flatnonzero(known.any(axis=1) & ~line.faces)
    force, s = (line.covered * values)[partly].sum(axis=1), trace.places(line.segments)
    for i in partly:
        values[i] = np.interp(s[i], s[i, known[i]], values[i, known[i]])
    whole = (line.shares * values)[partly].sum(axis=1)
    values[partly] *= np.divide(force, whole, out=np.zeros(len(partly)), where=whole > 0)[:, None]
    return values


def pressure_at_vertices(trace: FacetTrace, state: ContactState) -> Array:
    """Pressures (k, 3) at the vertices of facets: of several facets the mean, by what faces."""
    line, whole = state.line, np.ones(len(state.force))
    vertices = trace.nodes[line.segments]
    size = trace.sizes(line.segments) * line.covered_shares(whole, whole)
    values = line.on_segments(state.pressure, np.nan)
    values = with_vertices(values, line.rows < 0, vertices, size)[:, :3]
    known = np.isfinite(values)
    share, at, n = (known * size[:, None])[known], vertices[:, :3], trace.mesh.nv
    area, total = (np.bincount(at[known], x, n) for x in (share, share * values[known]))
    return np.asarray((total / np.where(area > 0, area, 1.0))[at])


def _fitted(
    field: ng.GridFunction,
    trace: BoundaryTrace,
    segments: Index,
    s: Array,
    values: Array,
    weights: Array | None = None,
) -> ng.GridFunction:
    """The discontinuous `field` made nearest to `values` (k, g) at `s`, by `weights` (k, g)."""
    if not len(segments):
        return field
    at = (field.space.GetDofNrs(ng.ElementId(ng.BND, int(i))) for i in segments)
    numbers = np.array(list(at))
    functions = local_functions(field.space, numbers)
    places = s.reshape(values.size, *np.shape(trace.vertices)[1:])
    shapes = trace.evaluate(functions, segments.repeat(values.shape[1]), places)
    shapes = shapes.reshape(*values.shape, -1)
    weighted = shapes if weights is None else weights[..., None] * shapes
    weighted = weighted.transpose(0, 2, 1)
    found = np.linalg.solve(weighted @ shapes, weighted @ values[..., None])[..., 0]
    field.vec.FV().NumPy()[numbers] = found
    return field


def _mean_traction(
    solution: Solved, trace: FacetTrace, state: ContactState, mean: Array
) -> ng.GridFunction:
    """Mean traction of both sides along the direction, shifted to the `mean` (k,) of facets."""
    line, d = state.line, trace.order - 1
    boundary = solution.mesh.Boundaries(line.contact.secondary)
    facets = line.segments[state.touched]
    points, weights = triangle.gauss(2 * d)
    facet, s = trace.at_places(facets, points)
    directions, x = rays(trace, line.contact, facet, s), trace.point(facet, s)
    stress = solution.stress

    def traction(facet: Index, s: Array, directions: Array) -> Array:
        """Pressures (j,) along `directions` (j, 3), over areas as these see them."""
        both = trace.traction(stress, facet, s), trace.normal(facet, s)
        along, across = ((x * directions).sum(axis=1) for x in both)
        return np.asarray(-along / across)

    values = traction(facet, s, directions)
    if len(line.facing):
        found = partners(trace, line.facing, facet, x, directions)
        met = np.flatnonzero(found.segment >= 0)
        other = traction(found.segment[met], found.s[met], directions[met])
        values[met] = (values[met] + other) / 2
    size = jacobian(trace, line.contact, facet, s).reshape(-1, len(weights)) * weights
    values = values.reshape(size.shape)
    own = (size * values).sum(axis=1) / size.sum(axis=1)
    values += (mean[state.touched] - own)[:, None]
    field = ng.GridFunction(ng.SurfaceL2(trace.mesh, order=d, definedon=boundary))
    return _fitted(field, trace, facets, s, values, size)
