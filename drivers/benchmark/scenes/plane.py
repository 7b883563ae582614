"""A common problem in arrays, whatever the numbering of the code that assembled its matrix."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from drivers.benchmark.scenes.problems import Common
from ngcontact import Elastic
from ngcontact.arrays import from_triplets

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Numbering:
    """Nodes of order 1 or 2 and the unknowns of a code.

    Attributes
    ----------
    points : Array
        Vertices (nv, 2), the first nodes.
    unknown : Indices
        Unknowns (2, n) of the displacement of all nodes.
    segments : dict
        Nodes (k, order + 1) of the segments of each boundary: end, middle if order 2, end.
    """

    points: Array
    unknown: Indices
    segments: dict[str, Indices]

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


def moduli(common: Common) -> tuple[float, float]:
    """Lame's lambda and mu of plane strain, the same in all bodies."""
    [law] = common.problem.materials.values()
    assert isinstance(law, Elastic)
    E, nu = law.E, law.nu
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def constant(value: ng.CoefficientFunction) -> float:
    """Number that a constant CoefficientFunction stands for."""
    mesh = ng.Mesh(ng.unit_square.GenerateMesh(maxh=1))
    return float(value(mesh(0.5, 0.5)))


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
    """Contact nodes in order of x.

    Attributes
    ----------
    x : Array
        Of the nodes (m,).
    at : Indices
        Vertical unknowns (m,) of the secondary.
    opposite : Indices or None
        Those (m,) of the primary, if there is one.
    gap : Array
        Before deformation (m,).
    """

    x: Array
    at: Indices
    opposite: Indices | None
    gap: Array


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


@dataclass(frozen=True, eq=False)
class Bounded:
    """min v'Kv/2 - f'v over v with v[fixed] = value[fixed] and v[at] >= lower.

    Attributes
    ----------
    K : csr_array
        Stiffness (n, n), symmetric.
    f, value : Array
        Load and prescribed values (n,).
    fixed : Mask
        Prescribed unknowns (n,).
    at : Indices
        Unknowns bounded from below (m,).
    lower : Array
        Bounds (m,).
    """

    K: sp.csr_array
    f: Array
    value: Array
    fixed: Mask
    at: Indices
    lower: Array


def bounded(
    common: Common, K: sp.csr_array, f: Array, numbering: Numbering, basis: sp.csr_array | None
) -> tuple[Bounded, Facing]:
    """The problem with one bound per contact node, and those nodes.

    Where two bodies meet, the unknown of a secondary node is its opening over the node opposite.
    `basis` (n, n) turns nodal values into unknowns where the code's own are others.
    """
    line = facing(common, numbering)
    if line.opposite is not None:
        ties = from_triplets(np.ones(len(line.at)), line.at, line.opposite, K.shape)
        opening = ties + sp.eye_array(len(f), format="csr")
        basis = opening if basis is None else basis @ opening
    if basis is not None:
        K, f = (basis.T @ K @ basis).tocsr(), basis.T @ f
    fixed, value = prescribed(common, numbering)
    return Bounded(K, f, value, fixed, line.at, -line.gap), line
