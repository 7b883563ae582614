"""Moduli, and initial strains, that change or jump inside elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..errors import warn
from ..problem import Problem, numbers, varies
from .cells import SampledElements, lattice
from .features import features_of

# Change of a law in an element over its least value there, of an initial strain over its largest in
# the body, from which it is rough there, or jumps.
JUMP_CHANGE = 0.5
HALVINGS = 24  # of the distance between two points: what still changes across 1e-7 of it jumps


class Jump(NamedTuple):
    """Jump of a law in one element."""

    place: tuple[float, float]  # lengths
    low: float  # the value on one side of the component that jumps
    high: float  # and on the other


@dataclass(frozen=True, eq=False)
class RoughElements:
    """Elements of about one size in which a law, or a strain, changes by a share of itself, k."""

    view: SampledElements
    C: ng.CoefficientFunction  # (q, q), or a strain of c components
    at: Index  # (k,)
    values: Array  # (k, n, q q), or (k, n, c), at the points of a lattice
    limit: Array  # (k,), of a change

    def jumps(self) -> dict[int, Jump]:
        """Jumps by number of the element, at most one in each.

        From the points of a lattice at which a component is least and largest, the half of their
        distance across which it changes more is kept, again and again: a smooth change shrinks by
        that.
        """
        which, row = np.ptp(self.values, axis=1).argmax(axis=1), np.arange(len(self.at))
        of = self.values[row, :, which]  # the component (k, n) that changes most
        ends = np.column_stack([of.argmin(axis=1), of.argmax(axis=1)])
        x, u = lattice(2, round(of.shape[1] ** 0.5))[ends], of[row[:, None], ends]
        for _ in range(HALVINGS):
            middle = x.mean(axis=1)
            v = self.view.sample(self.C, self.at, middle[:, None])[row, 0, which]
            side = (np.abs(v - u[:, 0]) > np.abs(v - u[:, 1])).astype(int)  # which end to move
            x[row, side], u[row, side] = middle, v
        kept = np.ptp(u, axis=1) > self.limit
        places, u = self.view.positions(self.at[kept], x[kept, 0]), np.sort(u[kept], axis=1)
        found = zip(places.tolist(), *u.T.tolist(), strict=True)
        return {k: Jump((x, y), *of) for k, ((x, y), *of) in zip(self.at[kept], found, strict=True)}


def _rough(problem: Problem, mesh: ng.Mesh) -> Iterator[tuple[str, RoughElements]]:
    """Elements in which laws are rough, then initial strains, by the body."""
    view = SampledElements(mesh, 2)
    for pattern, law in problem.materials.items() if mesh.dim == 2 else ():
        if not varies(law):
            continue
        C = law.voigt(problem.model)
        for here, values in view.samples(C, view.inside(mesh.Materials(pattern))):
            limit = JUMP_CHANGE * values[..., :: C.dims[0] + 1].mean(axis=2).min(axis=1)
            k = np.flatnonzero(np.ptp(values, axis=1).max(axis=1) > limit)
            if len(k):
                yield f'materials "{pattern}"', RoughElements(view, C, here[k], values[k], limit[k])
    if all(map(numbers, problem.strain.values())):
        return
    for one in features_of(problem, mesh):
        if one.kind != "strain":
            continue
        e0, limit = problem.strain[one.name], JUMP_CHANGE * one.largest
        for here, values in view.samples(e0, view.inside(mesh.Materials(one.name))):
            k = np.flatnonzero(np.ptp(values, axis=1).max(axis=1) > limit)
            if len(k):
                limits = np.full(len(k), limit)
                found = RoughElements(view, e0, here[k], values[k], limits)
                yield f'initial strains of "{one.name}"', found


def rough_moduli(problem: Problem, mesh: ng.Mesh) -> Mask:
    """Elements (ne,) in which the law, or an initial strain, varies by half of itself, or jumps."""
    rough = np.zeros(mesh.ne, dtype=bool)
    for _, elements in _rough(problem, mesh):
        rough[elements.at] = True
    return rough


def jumping_moduli(problem: Problem, mesh: ng.Mesh) -> Mask:
    """Elements (ne,) in which the law jumps, by more than half of itself, and their neighbours.

    A line may cut off a corner that no point of a small element shows.
    """
    view, jumps = SampledElements(mesh, 2), np.zeros(mesh.ne, dtype=bool)
    for _, elements in _rough(problem, mesh):
        jumps[[*elements.jumps()]] = True
    return view.with_neighbours(jumps, np.arange(mesh.ne))


def warn_of_jumps(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of every law, or strain, that jumps inside elements, where it jumps most."""
    jumps: dict[str, list[Jump]] = {}
    for pattern, elements in _rough(problem, mesh):
        jumps.setdefault(pattern, []).extend(elements.jumps().values())
    for pattern, found in jumps.items():
        if found:
            (x, y), low, high = max(found, key=lambda jump: jump.high - jump.low)
            warn(
                f"{pattern} jump inside {len(found)} elements, most near "
                f"({x:.4g}, {y:.4g}): a component from {low:.3g} to {high:.3g}. No order "
                "converges fast there; make the line an edge of the geometry, with a body of its "
                "own on either side"
            )
