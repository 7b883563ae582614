"""A common problem in arrays, and how answers are read.

Nodal forces and gaps are read in the same way for every engine; the choices are those that came
closest to the references on both common problems.
"""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from drivers.benchmark.scenes.meshes import OBSTACLE
from drivers.benchmark.scenes.problems import Common
from ngcontact import Elastic

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Integrals of the shape functions over one segment of unit length, nodes from left to right.
WEIGHTS = {1: np.array([1, 1]) / 2, 2: np.array([1, 4, 1]) / 6}
WINDOW = 0.3  # of the contact zone, on which the pressure is taken for a parabola
OPEN = 6  # open nodes that find the end of contact


@dataclass(frozen=True, eq=False)
class Numbering:
    """Nodes of order 1 or 2 and their unknowns."""

    points: Array  # vertices (nv, 2), the first nodes
    unknown: Indices  # (2, n) of the displacement of all nodes, by component
    segments: dict[str, Indices]  # nodes (k, order + 1) by boundary: end, middle if order 2, end

    def at(self, pattern: str) -> Indices:
        """Nodes of the boundaries named in ``a|b``, each once."""
        return np.unique(np.concatenate([self.segments[n].ravel() for n in pattern.split("|")]))

    def line(self, common: Common, name: str) -> tuple[Indices, Array]:
        """Nodes (m,) of a contact boundary from left to right, and their places (m, 2)."""
        segments = self.segments[name]
        ends = segments[:, [0, -1]]
        nodes, place = [ends.ravel()], [self.points[ends].reshape(-1, 2)]
        if segments.shape[1] == 3:
            nodes.append(segments[:, 1])
            place.append(common.on_curve(self.points[ends].mean(axis=1)))
        found, first = np.unique(np.concatenate(nodes), return_index=True)
        places = np.concatenate(place)[first]
        order = np.argsort(places[:, 0])
        return found[order], places[order]


def modulus(common: Common) -> Elastic:
    """The law of all bodies."""
    [law] = common.problem.materials.values()
    assert isinstance(law, Elastic)
    return law


def moduli(common: Common) -> tuple[float, float]:
    """Lame's lambda and mu of plane strain, the same in all bodies."""
    E, nu = modulus(common).E, modulus(common).nu
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def constant(value: ng.CoefficientFunction) -> float:
    """Number that a constant CoefficientFunction stands for."""
    mesh = ng.Mesh(ng.unit_square.GenerateMesh(maxh=1))
    return float(value(mesh(0.5, 0.5)))


def contact_sides(common: Common) -> tuple[str, str]:
    """Boundaries of the secondary and the primary, that of an obstacle's mesh if it is rigid."""
    [contact] = common.problem.contact
    return contact.secondary, contact.primary or f"{OBSTACLE}_contact"


def supports(common: Common) -> dict[str, tuple[float | None, ...]]:
    """Prescribed components on each boundary; a sliding boundary is vertical."""
    result = {
        name: tuple(None if u is None else constant(u) for u in pair)
        for name, pair in common.problem.displacement.items()
    }
    return {**result, str(common.problem.sliding): (0.0, None)}


def pressures(common: Common) -> dict[str, float]:
    """Pressure on each loaded boundary."""
    return {name: constant(p) for name, p in common.problem.traction.items()}


def prescribed(common: Common, numbering: Numbering) -> tuple[Mask, Array]:
    """Supported unknowns (n,) and their values (n,), zero elsewhere."""
    fixed = np.zeros(numbering.unknown.size, dtype=bool)
    value = np.zeros(numbering.unknown.size)
    for pattern, components in supports(common).items():
        for unknown, wanted in zip(numbering.unknown, components, strict=True):
            if wanted is not None:
                fixed[unknown[numbering.at(pattern)]] = True
                value[unknown[numbering.at(pattern)]] = wanted
    return fixed, value


@dataclass(frozen=True, eq=False)
class Facing:
    """Contact nodes in order of x."""

    x: Array  # of the nodes (m,)
    at: Indices  # vertical unknowns (m,) of the secondary
    opposite: Indices | None  # those (m,) of the primary, if there is one
    gap: Array  # before deformation (m,)


def facing(common: Common, numbering: Numbering) -> Facing:
    """Contact nodes of a problem; raises if those of two bodies do not match."""
    [contact] = common.problem.contact
    nodes, place = numbering.line(common, contact.secondary)
    at = numbering.unknown[1, nodes]
    if contact.primary is None:
        return Facing(place[:, 0], at, None, place[:, 1])
    opposite, there = numbering.line(common, contact.primary)
    if len(opposite) != len(nodes) or not np.allclose(place, there):
        raise ValueError("facing nodes differ: expected a mesh with matched contact lines")
    return Facing(place[:, 0], at, numbering.unknown[1, opposite], np.zeros(len(at)))


@dataclass(frozen=True)
class Reading:
    """Contact quantities, as in `problems.Reference`."""

    force: float
    peak: float
    half_width: float


def read(common: Common, x: Array, force: Array, gap: Array, order: int) -> Reading:
    """Reading of nodal forces and gaps (m,) at nodes x (m,), in order from 0."""
    return Reading(
        force=common.parts * float(force.sum()),
        peak=peak(x, force, order),
        half_width=contact_end(x, force, gap),
    )


def weights(x: Array, order: int) -> Array:
    """Length (m,) that each node stands for: integral of its shape function over x."""
    result = np.zeros(len(x))
    for k, weight in enumerate(WEIGHTS[order]):
        result[k : len(x) - order + k : order] += weight * (x[order::order] - x[:-order:order])
    return result


def peak(x: Array, force: Array, order: int) -> float:
    """Pressure at x = 0 from nodal forces.

    Force over weight there for order 2. That is off by a percent for order 1, whose first nodes
    oscillate: an even parabola through the nodes within 0.3 of the zone is 10 times better.
    """
    pressure, weight = force / weights(x, order), weights(x, order)
    last = np.flatnonzero(force > 0)[-1]
    count = min(last + 1, max(3, int(np.searchsorted(x, WINDOW * x[last]))))
    if order == 2 or count < 2:
        return float(pressure[0])
    # Unlike pressures, forces carry over to the neighbours what one node has too much of.
    _, value = np.polyfit(x[:count] ** 2, pressure[:count], 1, w=np.sqrt(weight[:count]))
    return float(value)


def contact_end(x: Array, force: Array, gap: Array) -> float:
    """End of contact, found inside elements: gap^(2/3) is smooth with a simple zero there."""
    last = int(np.flatnonzero(force > 0)[-1])
    near = slice(last + 1, last + 1 + OPEN)
    middle = float(x[last : last + 2].mean())
    opening = np.cbrt(np.maximum(gap[near], 0) ** 2)
    if len(opening) < 2:
        return middle
    zeros = np.roots(np.polyfit(x[near] - middle, opening, min(2, len(opening) - 1)))
    zeros = zeros[np.isreal(zeros)].real
    return middle + float(min(zeros, key=abs, default=0.0))
