"""Arrays from which an equilibrated stress and its bound can be checked without the package."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....arrays import Array
from ....lagrange import gauss
from ..data import Discrete, EdgeConditions, Units, basis, lattice, legendre_values
from ..liftings import Gap


@dataclass(frozen=True, eq=False)
class Norms:
    """Norms on the n triangles.

    Attributes
    ----------
    constitutive, loads, curves, lifting : ndarray (n,)
        By what they are of.
    """

    constitutive: Array
    loads: Array
    curves: Array
    lifting: Array

    def bound(self, closed: float, units: Units) -> float:
        """B, in the units of the data."""
        both = self.constitutive + self.loads + self.curves
        square = float(both @ both + self.lifting @ self.lifting) + 2 * closed
        return math.sqrt(square) * units.root


@dataclass(frozen=True, eq=False)
class Proof:
    """What proves a bound, in units of its own.

    Attributes
    ----------
    discrete : Discrete
        The discrete solution on n triangles.
    conditions : EdgeConditions
        Of e edges.
    given : ndarray (e, 2, r)
        Tractions asked for.
    raw : ndarray (n, 3, m)
        Coefficients of the stress.
    gaps : sequence of Gap
        The pairs.
    pressures : sequence of ndarray (m,)
        Coefficients of p* of each.
    norms : Norms
        On the triangles.
    bound : float
        B, in the units of the data.
    units : Units
        Of the data.
    """

    discrete: Discrete
    conditions: EdgeConditions
    given: Array
    raw: Array
    gaps: Sequence[Gap]
    pressures: Sequence[Array]
    norms: Norms
    bound: float
    units: Units

    def arrays(self) -> dict[str, Array]:
        """All arrays by name; docs/bounds.md says what they are.

        Each is in units of the data: lengths, stresses (n, 3, m), roots of energies (n,).

        Raises
        ------
        ValueError
            Curved triangles or laws that vary, for which arrays at a few points prove nothing.
        """
        discrete, partition, units = self.discrete, self.discrete.partition, self.units
        if discrete.rough is not None:
            raise ValueError(
                f"{len(discrete.rough.at)} triangles are curved, of a law that varies or about an "
                "axis: a certificate can be saved of plane triangles, straight and of constant laws"
            )
        k = discrete.degree
        points = lattice(k)
        values = basis(k).values(points)
        low, force = discrete.stress.shape[2], discrete.force.sum(axis=1)
        root = units.root
        arrays = {
            "degree": np.array(k),
            "vertices": partition.vertices * units.length,
            "triangles": partition.triangles,
            "lattice": points,
            "stress": np.einsum("qi,nci->nqc", values, self.raw) * units.stress,
            "discrete_stress": np.einsum("qi,nci->nqc", values[:, :low], discrete.stress)
            * units.stress,
            "force": np.einsum("qi,nci->nqc", values[:, : force.shape[2]], force)
            * (units.stress / units.length),
            "law": discrete.law * units.modulus,
            "loads": (self.norms.loads + self.norms.curves) * root,
            "lifting": self.norms.lifting * root,
            "bound": np.array(self.bound),
        }
        return arrays | self._edges() | self._contact()

    def _edges(self) -> dict[str, Array]:
        """The boundary: from vertex i + 1 to i + 2 of its triangle, at Gauss points."""
        partition = self.discrete.partition
        edge = np.flatnonzero(partition.segment >= 0)
        triangle, side = (x[edge] for x in partition.owner)
        s, _ = gauss(2 * self.discrete.degree)
        t = np.where(partition.flips[triangle, side][:, None], 1 - s, s)
        values = legendre_values(self.discrete.degree, t.ravel()).reshape(*t.shape, -1)
        total = self.given[edge].sum(axis=1).reshape(len(edge), 2, -1)
        constrained = self.conditions.constrained[edge].reshape(len(edge), 2, -1)[:, :, 0]
        return {
            "edge_triangle": triangle,
            "edge_side": side,
            "edge_points": s,
            "edge_frame": self.conditions.frames[edge],
            "edge_constrained": constrained,
            "edge_traction": np.einsum("eqi,efi->eqf", values, total) * self.units.stress,
        }

    def _contact(self) -> dict[str, Array]:
        """The secondary sides of all pairs, piece by piece, and p* on them."""
        parts: dict[str, list[Array]] = {name: [] for name in CONTACT}
        partition, units, pieces_before = self.discrete.partition, self.units, 0
        for number, (gap, b) in enumerate(zip(self.gaps, self.pressures, strict=True)):
            pieces, every = gap.pieces, np.arange(len(gap.pieces.local))
            if every.size == 0:
                continue
            t, w = gap.panels(every)
            value, r, _ = gap.lifted(every, t)
            weight = gap.points.weight.reshape(len(every), -1)[:, :1]  # straight: a constant
            place = pieces.start[:, None] + (pieces.stop - pieces.start)[:, None] * t
            edge = partition.edge_of_segment[pieces.segment]
            triangle, side = (x[edge] for x in partition.owner)
            forwards = partition.along[edge] != partition.flips[triangle, side]
            coefficients = np.append(b, 0.0)[gap.zone.number[pieces.local]] * units.stress
            mirrored = np.where(forwards[:, None], coefficients, coefficients[:, ::-1])
            length = partition.edge_lengths[edge] * (pieces.stop - pieces.start)
            opened = np.maximum(value + r, 0.0) * units.strain * units.length
            found = {
                "contact_pair": np.full(len(every), number),
                "contact_triangle": triangle,
                "contact_side": side,
                "contact_pressure": mirrored,
                "contact_direction": gap.points.direction.reshape(len(every), -1, 2)[:, 0],
                "contact_stretch": weight[:, 0] / length,
                "contact_unilateral": np.full(len(every), not pieces.line.contact.bilateral),
                "gap_piece": np.repeat(pieces_before + every, t.shape[1]),
                "gap_place": np.where(forwards[:, None], place, 1 - place).ravel(),
                "gap_weight": (weight * w).ravel() * units.length,
                "gap_open": opened.ravel(),
            }
            pieces_before += len(every)
            for name, array in found.items():
                parts[name].append(array)
        return {name: np.concatenate(part) for name, part in parts.items() if part}


CONTACT = (
    *("contact_pair", "contact_triangle", "contact_side", "contact_pressure"),
    *("contact_direction", "contact_stretch", "contact_unilateral"),
    *("gap_piece", "gap_place", "gap_weight", "gap_open"),
)
