"""Moduli that change or jump inside elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..errors import warn
from ..problem import MeshArrays, Problem, varies
from .cells import lattice
from .sampling import SampledElements

CHANGE = 0.5  # of a law in an element over its least value, from which it is rough there, or jumps
HALVINGS = 24  # of the distance between two points: what still changes across 1e-7 of it jumps


class Jumps(NamedTuple):
    """Where a law jumps, at most one place in each element."""

    element: Index  # (k,)
    place: Array  # (k, 2), lengths
    least: Array  # (k,), the value on one side of the component that jumps
    most: Array  # (k,), and on the other


@dataclass(frozen=True, eq=False)
class VaryingLaw:
    """A law C (q, q) that is a function, and the triangles that it is the law of."""

    pattern: str
    C: ng.CoefficientFunction
    view: SampledElements
    elements: Index  # (j,)

    def rough(self) -> Iterator[tuple[Index, Array]]:
        """Elements (k,) in which it changes by a share of itself, and values (k, n, c), c = q q."""
        for here, values in self.view.samples(self.C, self.elements):
            k = np.flatnonzero(np.ptp(values, axis=1).max(axis=1) > self._limits(values))
            if len(k):
                yield here[k], values[k]

    def _limits(self, values: Array) -> Array:
        diagonal = values[..., :: self.C.dims[0] + 1]
        return CHANGE * diagonal.mean(axis=2).min(axis=1)

    def jumps(self) -> Jumps:
        """Where it jumps.

        From the points of a lattice at which a component is least and largest, the half of their
        distance across which it changes more is kept, again and again: a smooth change shrinks by
        that.
        """
        found = [Jumps(np.empty(0, np.intp), np.empty((0, 2)), np.empty(0), np.empty(0))]
        for at, values in self.rough():
            which, row = np.ptp(values, axis=1).argmax(axis=1), np.arange(len(at))
            of = values[row, :, which]  # the component (k, n) that changes most
            ends = np.column_stack([of.argmin(axis=1), of.argmax(axis=1)])
            x, u = lattice(2, round(of.shape[1] ** 0.5))[ends], of[row[:, None], ends]
            for _ in range(HALVINGS):
                middle = x.mean(axis=1)
                v = self.view.look(self.C, at, middle[:, None])[row, 0, which]
                side = (np.abs(v - u[:, 0]) > np.abs(v - u[:, 1])).astype(int)  # which end to move
                x[row, side], u[row, side] = middle, v
            kept = np.abs(u[:, 1] - u[:, 0]) > self._limits(values)
            place = self.view.positions(at[kept], x[kept, 0])
            found.append(Jumps(at[kept], place, u[kept].min(axis=1), u[kept].max(axis=1)))
        return Jumps(*map(np.concatenate, zip(*found, strict=True)))


def _varying(problem: Problem, mesh: ng.Mesh) -> Iterator[VaryingLaw]:
    """All laws that are functions."""
    view = SampledElements(mesh, 2)
    for pattern, law in problem.materials.items():
        if varies(law):
            inside = view.inside(mesh.Materials(pattern))
            yield VaryingLaw(pattern, law.voigt(problem.model), view, inside)


def rough_moduli(problem: Problem, mesh: ng.Mesh) -> Mask:
    """Elements (ne,) in which the law varies by more than half of itself, or jumps."""
    rough = np.zeros(mesh.ne, dtype=bool)
    for law in _varying(problem, mesh):
        for elements, _ in law.rough():
            rough[elements] = True
    return rough


def jumping_moduli(problem: Problem, mesh: ng.Mesh) -> Mask:
    """Elements (ne,) in which the law jumps, by more than half of itself, and their neighbours.

    A line may cut off a corner that no point of a small element shows.
    """
    triangles = MeshArrays(mesh).elements
    touched = np.zeros(mesh.nv, dtype=bool)
    for law in _varying(problem, mesh):
        touched[triangles[law.jumps().element]] = True
    return np.asarray(touched[triangles].any(axis=1))


def warn_of_jumps(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of every law that jumps inside elements, where it jumps most."""
    for law in _varying(problem, mesh):
        found = law.jumps()
        if len(found.element):
            k = int(np.argmax(found.most - found.least))
            x, y = found.place[k]
            warn(
                f'materials "{law.pattern}" jump inside {len(found.element)} elements, most near '
                f"({x:.4g}, {y:.4g}): a stiffness from {found.least[k]:.3g} to "
                f"{found.most[k]:.3g}. No order converges fast there; make the line an edge of the "
                "geometry, with a body of its own on either side"
            )
