"""Singular points and limits: elements that are refined whatever their indicators, or never."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Mask, joined
from ..contact import ContactState
from ..errors import warn
from ..fem import BoundaryTrace, boundary_corners, prescribed_components
from ..mesh import resolved_lengths
from ..problem import MeshArrays, Problem

END_POWER = 1.5  # u ~ r^(3/2) where contact ends: the squared error of an element is ~ h^3
CHANGE_POWER = 0.75  # of conditions: u ~ r^0.71 where right angles are clamped to one side
CORNER_POWER = 0.5  # that point inwards: u ~ r^0.54 where 270 degrees are free, r^(1/2) at slits
BLUNT_ANGLE = 0.1  # radians by which the normal turns at a corner that points inwards
MIN_HALVED_LENGTH = 2.5  # least length that halves need, whose sizes differ by a quarter at most
RESOLUTION_RADIUS = 1e-3  # radius of discs in which nothing is refined, over the extent of the mesh


def at_ends(trace: BoundaryTrace, pairs: Sequence[ContactState], share: float) -> Mask:
    """Elements (ne,) in which contact ends, larger than a `share` of their contact line."""
    marked = np.zeros(trace.mesh.ne, dtype=bool)
    for pair in pairs:
        x, segments = pair.line.position, pair.ending_segments
        extent = np.linalg.norm(np.ptp(x, axis=0)) if len(x) else 0.0
        marked[trace.element[segments[trace.lengths(segments) > share * extent]]] = True
    return marked


def at_limit(mesh: ng.Mesh, degree: int) -> Mask:
    """Elements (ne,) at segments, of curves of a `degree`, whose halves no kernel resolves."""
    limit = np.zeros(mesh.ne, dtype=bool)
    if degree > 1:  # straight segments have no middles to place
        short = resolved_lengths(mesh) < MIN_HALVED_LENGTH
        if short.any():
            limit[MeshArrays(mesh).facet_elements[short]] = True
    return limit


def warn_of_limit(trace: BoundaryTrace, *, ends: bool) -> None:
    """Warn of the shortest segment `at_limit`, and of what follows: whether refinement `ends`."""
    shortest = int(np.argmin(resolved_lengths(trace.mesh)))
    x, y = trace.curve[shortest].mean(axis=0)
    name = trace.mesh.GetBoundaries()[trace.region[shortest]]
    what = "refinement ends here" if ends else "it is not divided any more, others are"
    warn(
        f'a segment of the curved edge "{name}" near ({x:.4g}, {y:.4g}) has the length '
        f"{trace.lengths(np.array([shortest]))[0]:.2g}, and the geometry kernel loses digits on "
        f"its halves: {what}; choose a smaller unit of length if the estimate is too large"
    )


def below_resolution(mesh: ng.Mesh, places: Array) -> Mask:
    """Elements (ne,) within a thousandth of the extent of `places` (k, 2) of infinite energy."""
    view = MeshArrays(mesh)
    radius = RESOLUTION_RADIUS * np.ptp(view.vertices, axis=0).max()
    result = np.zeros(mesh.ne, dtype=bool)
    for place in places:
        near = np.linalg.norm(view.vertices - place, axis=1) <= radius
        result |= near[view.elements].all(axis=1)
    return result


@dataclass(frozen=True, eq=False)
class Singularities:
    """Points, and how the squared error of an element there falls with its area."""

    places: Array  # (k, 2), lengths
    powers: Array  # (k,), of the area
    extents: Array  # (k,), lengths of the contact lines that end there, infinite elsewhere

    @classmethod
    def at(cls, places: ArrayLike, power: float, extent: float = np.inf) -> Singularities:
        """Those at `places` (k, 2), all of one power; 0 where supports contradict each other."""
        x = np.reshape(places, (-1, 2))
        return cls(x, np.full(len(x), power), np.full(len(x), extent))

    @property
    def unresolvable(self) -> Array:
        """Places (j, 2) of infinite energy, lengths."""
        return self.places[self.powers == 0]


def ends_of_contact(pairs: Sequence[ContactState]) -> Singularities:
    """Singularities at transitions from binding to non-binding contact, on both bodies."""
    found = [Singularities.at([], END_POWER)]
    for pair in pairs:
        line, ends = pair.line, pair.transitions
        extent = float(np.linalg.norm(np.ptp(line.position, axis=0))) if line.node.size else 0.0
        found.append(Singularities.at(ends.position, END_POWER, extent))
        if line.contact.primary is not None:
            inner, outer = line.position[ends.inner], line.position[ends.outer]
            apart = np.linalg.norm(outer - inner, axis=1)
            s = np.linalg.norm(ends.position - inner, axis=1) / np.where(apart > 0, apart, np.inf)
            gap = (1 - s) * line.gap[ends.inner] + s * line.gap[ends.outer]
            facing = ends.position + gap[:, None] * line.direction[ends.inner]
            found.append(Singularities.at(facing, END_POWER, extent))
    return joined(found)


def corners(problem: Problem, trace: BoundaryTrace) -> Singularities:
    """Vertices where one condition ends and another begins, and those that point inwards."""
    sides = [side for pair in problem.contact for side in pair.sides]
    masks = [trace.lies_on(slice(None), x) for x in (*problem.traction, problem.guide, *sides)]
    every = np.concatenate([prescribed_components(problem, trace), masks])
    kind = np.unique(every, axis=1, return_inverse=True)[1].ravel()  # of equal conditions one
    found = boundary_corners(trace)
    ends, changing = (np.diff(x[found.sides])[:, 0] != 0 for x in (trace.region, kind))
    inwards = ends & (found.angle > np.pi + BLUNT_ANGLE)  # where CAD edges end
    x = trace.arrays.vertices[found.vertex]
    places = (x[changing & ~inwards], CHANGE_POWER), (x[inwards], CORNER_POWER)
    return joined([Singularities.at(*each) for each in places])
