"""Pairs of boundaries that face each other, found in a drawing or a mesh."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry
from scipy.spatial import cKDTree

from ..arrays import Array, Index
from ..errors import warn
from ..fem import BoundaryTrace, boundary_trace
from ..mesh import curve, first_mesh
from ..problem import Contact, Elastic, MeshArrays, Problem, check_mesh, scalar_data
from .facing import partners
from .nodal import with_roles

PLACES = (np.arange(8) + 0.5) / 8  # of a segment, at which distances are looked at
OPPOSED_COSINE = -0.5  # cosine between normals up to which boundaries face each other
# In which the part of a segment where a gap is least is looked at four times closer.
SEARCH_ROUNDS = 6
CURVED = 6  # degree of the mesh of a drawing


@dataclass(frozen=True, eq=False)
class FoundContact(Contact):
    """A pair that `find_contacts` found.

    Attributes
    ----------
    least_gap : float
        The least distance along the normals of the secondary, a length; negative where bodies
        overlap.
    place : tuple of float (2,)
        The point of the secondary where that is, lengths.
    """

    least_gap: float = 0.0
    place: tuple[float, float] = (0.0, 0.0)

    def __str__(self) -> str:
        """Both sides, and how far they are apart."""
        x, y = self.place
        return f"{self.named()}, gap {self.least_gap:.3g} near ({x:.4g}, {y:.4g})"


def find_contacts(geometry: OCCGeometry | ng.Mesh, *, within: float) -> list[FoundContact]:
    """Pairs of boundaries of different bodies that face each other, ready for `Problem`.

    Bodies are connected pieces; boundaries are known by their names. The secondary is the side that
    the other one covers wholly, of two the finer, of equal ones the convex one (`roles="auto"`).

    Parameters
    ----------
    geometry
        As of `Problem`.
    within
        The largest gap, or overlap, along a normal, a length.

    Returns
    -------
    list of FoundContact
        In the order of the boundaries; empty, with a `ContactWarning`, where none is near enough.

    Raises
    ------
    TypeError, ValueError
        `within` is not positive; sides that face each other have one name, or none.
    """
    reach = scalar_data(within, "within")
    if not (isinstance(reach, float) and reach > 0):
        raise ValueError(f"within = {within}: give a positive length")
    problem = Problem(geometry, {".*": Elastic(E=1.0, nu=0.0)})
    problem.refuse_solids("find_contacts")
    mesh = first_mesh(problem)
    check_mesh(mesh, 2)
    trace = boundary_trace(curve(mesh, CURVED, "isoparametric")[0], 1)
    seen = {pair: _least(trace, *facing) for pair, facing in _facing(trace, reach).items()}
    near = {pair: found for pair, found in seen.items() if abs(found[0]) <= reach}
    found = []
    for pair in dict.fromkeys(min(pair, pair[::-1]) for pair in near):
        known = [sides for sides in (pair, pair[::-1]) if sides in near]
        if pair[0] == pair[1] or {"", "default"} & set(pair):
            x, y = near[known[0]][1]
            raise ValueError(
                f'boundaries "{pair[0]}" and "{pair[1]}" of two bodies face each other near '
                f"({x:.6g}, {y:.6g}): give both sides names of their own"
            )
        one, other = map(re.escape, pair)
        roles = with_roles(trace, Contact(one, other, roles="auto"))
        own = next((sides for sides in known if re.escape(sides[0]) == roles.secondary), known[0])
        gap, place = near[own]
        found.append(FoundContact(roles.secondary, roles.primary, least_gap=gap, place=place))
    if not found:
        nearest = ""
        if seen:
            gap, one, other = min((abs(gap), *pair) for pair, (gap, _) in seen.items())
            nearest = f'; "{one}" is {gap:.4g} apart from "{other}"'
        warn(
            f"no boundaries of different bodies face each other within {within:g}{nearest}; bodies "
            "with common vertices are one (join them by Compound, not Glue)"
        )
    return found


def _facing(
    trace: BoundaryTrace, within: float
) -> dict[tuple[str, str], tuple[Index, float, Index]]:
    """The sample with the least gap, by the names of both sides, each as the first in turn.

    Its segment (1,) and parameter, and the segments (q,) of the other body. Of connected bodies
    whose boxes are so near.
    """
    outer = np.flatnonzero(~trace.inner)
    names = np.array(trace.mesh.GetBoundaries())[trace.region]
    piece = MeshArrays(trace.mesh).pieces[trace.nodes[:, 0]]
    parts = [outer[piece[outer] == k] for k in np.unique(piece)]
    curves = [trace.curve[part].reshape(-1, 2) for part in parts]
    boxes = np.array([(x.min(axis=0), x.max(axis=0)) for x in curves])
    reach = within + np.array([trace.lengths(part).max() for part in parts]) / len(PLACES)
    found: dict[tuple[str, str], tuple[Index, float, Index]] = {}
    for a, b in itertools.permutations(range(len(parts)), 2):
        low, high = boxes[[a, b], 0].max(axis=0), boxes[[a, b], 1].min(axis=0)
        if (low > high + reach[b]).any():
            continue
        segment, s = trace.at_places(parts[a], PLACES)
        points = trace.point(segment, s)
        other = trace.point(*trace.at_places(parts[b], PLACES))
        distance, _ = cKDTree(other).query(points, distance_upper_bound=reach[b])
        some = np.flatnonzero(np.isfinite(distance))
        gap, facing = _gaps(trace, segment[some], s[some], parts[b])
        for k in np.argsort(np.abs(gap), kind="stable")[: np.count_nonzero(np.isfinite(gap))]:
            at = some[k]
            pair = str(names[segment[at]]), str(names[facing[k]])
            if pair not in found:
                found[pair] = segment[[at]], float(s[at]), parts[b]
    return found


def _gaps(trace: BoundaryTrace, segment: Index, s: Array, other: Index) -> tuple[Array, Index]:
    """Gaps (k,) along normals to segments `other` (q,), inf without, and the segments (k,) met."""
    normal = trace.exact_normal(segment, s)
    met = partners(trace, other, segment, trace.point(segment, s), normal, nodes=False)
    met.distance[met.segment < 0] = np.inf  # also of what lies beyond the own body
    at = np.flatnonzero(met.segment >= 0)
    opposed = (trace.normal(met.segment[at], met.s[at]) * normal[at]).sum(axis=1) <= OPPOSED_COSINE
    met.distance[at[~opposed]] = np.inf
    return met.distance, met.segment


def _least(
    trace: BoundaryTrace, segment: Index, at: float, other: Index
) -> tuple[float, tuple[float, float]]:
    """The least gap near a sample, on its segment (1,), and where it is."""
    width, steps = 2 * PLACES[0], np.linspace(-1, 1, 9)
    for _ in range(SEARCH_ROUNDS):
        s = np.unique(np.clip(at + width * steps, 0, 1))
        gap, _ = _gaps(trace, np.repeat(segment, len(s)), s, other)
        k = int(np.abs(gap).argmin())
        at, width = float(s[k]), width / 4
    x, y = trace.point(segment, np.array([at]))[0].tolist()
    return float(gap[k]), (x, y)
