"""Guaranteed bounds of a solution's error, their equilibrated stress, and its certificate."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...fem import LOAD_BONUS, load_vector, potential_energy
from ..residual import Estimated
from .bound import Proof, error_bound
from .facing import TO_ENDS, WEIGHTS, bernstein
from .polynomials import coordinates, scalars

ENERGY_ROUND_OFF = 64 * np.finfo(float).eps  # of an energy, relative to its terms
WORK_BONUS = 3 * LOAD_BONUS  # quadrature orders above the default for the work of loads
INSIDE_PART = 1e-9  # parameters nearer to an end are inside of the part that begins there
LATTICE_INSET = 0.1  # of a step of the lattice: it keeps off an axis, where s is not defined
SAME_DIRECTION = 1e-12  # difference of unit vectors that are one: round-off


@dataclass(frozen=True, eq=False)
class ContactPressure:
    """p* of one pair on k parts of segments.

    Attributes
    ----------
    segments : ndarray of int (k,)
        Segments of the boundary of the mesh, the secondary's.
    span : ndarray (k, 2)
        Parameters s on them at which each part begins and ends.
    coefficients : ndarray (k, d + 1)
        Of Bernstein polynomials from the beginning to the end, units of stress; per unit length
        (P1), per unit eta (P2).
    """

    segments: Index
    span: Array
    coefficients: Array

    def values(self, segment: Index, s: Array) -> Array:
        """p* (k,) at `s` (k,) of segments `segment` (k,), 0 where it does not act.

        At the end of two parts the one towards the middle of the segment.
        """
        inside, (low, high) = np.clip(s, INSIDE_PART, 1 - INSIDE_PART), np.sort(self.span).T
        beside = (self.segments == segment[:, None]) & (low <= inside[:, None])
        at, part = (beside & (inside[:, None] <= high)).nonzero()
        a, b = self.span[part].T
        basis = bernstein(self.coefficients.shape[1] - 1, (s[at] - a) / (b - a))
        found = np.zeros(len(segment))
        found[at] = (basis * self.coefficients[part]).sum(axis=1)
        return found


@dataclass(frozen=True, eq=False)
class EquilibratedStress:
    """A stress in equilibrium with the loads on n triangles.

    Attributes
    ----------
    proof : Proof
        What it was made of.
    """

    proof: Proof

    @property
    def element(self) -> Index:
        """Elements (n,) of the mesh that the triangles are, or parts of."""
        return self.proof.dual.cells.parent

    @property
    def pressure(self) -> list[ContactPressure]:
        """p* of each pair."""
        cells, lines = self.proof.dual.cells, self.proof.dual.lines
        found = zip(lines, self.proof.stress.pressure, self.proof.problem.contact, strict=False)
        return [ContactPressure(cells.segment[x.side], cells.span[x.side], p) for x, p, _ in found]

    @property
    def certificate(self) -> dict[str, float]:
        """Largest residual of equilibrium, relative to the largest stress; the least p*, a stress.

        The divergence holds by construction; what is left are jumps of tractions between triangles
        and from the given ones.
        """
        lines = zip(self.proof.dual.lines, self.proof.stress.pressure, strict=True)
        least = [p.min(initial=0.0) for line, p in lines if not line.equality]
        return {
            "tractions": self.proof.stress.residual,
            "least pressure": float(min(least, default=0.0)),
        }

    def values(self, element: Index, reference: Array) -> Array:
        """Stress (k, 3) as (xx, yy, xy), or (k, 4) as (rr, zz, hoop, rz), units of stress.

        Parameters
        ----------
        element : ndarray of int (k,)
            Elements of the mesh.
        reference : ndarray (k, 2)
            Places in them, NGSolve's reference coordinates.
        """
        proof, cells = self.proof, self.proof.dual.cells
        first = np.argsort(cells.parent, kind="stable")
        count = np.bincount(cells.parent, minlength=int(element.max(initial=0)) + 1)
        start, many = (np.cumsum(count) - count)[element], count[element]
        x = cells.elements.positions(element, reference)
        # Of the parts of an element the one that a place lies in, or is the nearest to.
        last, at = np.cumsum(many), np.repeat(np.arange(len(element)), many)
        part = first[np.arange(len(at)) + np.repeat(start - last + many, many)]
        share = coordinates(cells.corners[part], x[at, None])[:, 0]
        inside = np.minimum(share.min(axis=1), 1 - share.sum(axis=1))
        chosen = np.lexsort((-np.arange(len(at)), inside, at))[last - 1]
        own = part[chosen]
        found = proof.stress.s.values(own, share[chosen, None])[:, 0]
        if found.shape[1] > 3:
            found[:, 2] += _radial(proof, element, reference[:, None])[:, 0]
        return found

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write `path` (.npz): arrays that drivers/check_certificate.py checks with NumPy alone.

        Raises
        ------
        ValueError
            Another suffix, or a stress on curved triangles, of which there is no certificate.
        """
        path = Path(path)
        if path.suffix != ".npz":
            raise ValueError(f'path="{path}" must end in .npz')
        np.savez_compressed(path, **_certificate(self.proof))
        return path


def _radial(proof: Proof, element: Index, reference: Array) -> Array:
    """Radial force times r, (k, n), in elements `element` (k,) at places `reference` (k, n, 2)."""
    cells = proof.dual.cells
    force = cells.trace.mesh.MaterialCF(proof.problem.force, default=ng.CF((0, 0)))
    return cells.elements.evaluate(ng.x * force[0], element, reference)[..., 0]


def _certificate(proof: Proof) -> dict[str, Any]:
    """All arrays of the certificate by name; docs/bounds.md has the list.

    On cells with straight sides all that the proof needs is a polynomial in x: the stress times the
    model's measure (1, or 2 pi r), the force that it balances, tractions and p* on sides.

    Raises
    ------
    ValueError
        Where cells have curved sides, or normals of drawn curves turn along straight ones.
    """
    cells, lines, stress = proof.dual.cells, proof.dual.lines, proof.stress
    turns = sum((np.ptp(f.direction, axis=1) > SAME_DIRECTION).any(axis=1).sum() for f in lines)
    if cells.curved.any() or turns:
        raise ValueError(
            f"no certificate: {cells.curved.sum()} cells have a curved side, and the direction of "
            f"contact or a guide turns along {turns} sides; tractions are no polynomials there"
        )
    arrays: dict[str, Any] = {
        "axisymmetric": np.array(cells.trace.model.extent > 0),
        "vertices": cells.vertices,
        "triangles": cells.triangles,
        "loads": stress.loads,
        "lifting": proof.lifting,
        "bound": np.array(proof.bound),
    }
    # T and F, times the measure, at a lattice; by rules of quadrature e(u_h) and C^-1.
    k = proof.dual.elements[0].basis.degree
    i, j = np.array([(i, j) for i in range(k + 1) for j in range(k + 1 - i)]).T
    lattice = (np.column_stack([i, j]) + LATTICE_INSET) / (k + 3 * LATTICE_INSET)
    share = np.column_stack([1 - lattice.sum(axis=1), lattice])
    x = np.einsum("qc,ncd->nqd", share, cells.corners)
    T, force, measure = np.zeros((*x.shape[:2], 3)), np.zeros(x.shape), cells.measure(x)[..., None]
    for number, (e, c) in enumerate(zip(proof.dual.elements, stress.s.coefficients, strict=True)):
        at = e.places.at
        T[at] = e.stress(c, share[:, [2, 0]])[..., [0, 1, -1]]
        force[at] = scalars(e.basis.force_degree, e.basis.corners, x[at]) @ e.basis.force
        a, b = e.places.local.T
        weight = e.places.weight[0] / cells.measure(e.places.x[0])
        arrays |= {
            f"rule{number}_triangle": at,
            f"rule{number}_points": np.column_stack([1 - a - b, a]),
            f"rule{number}_weights": weight / (2 * weight.sum()),
            f"rule{number}_strain": e.strain,
            f"rule{number}_compliance": e.compliance,
            f"rule{number}_radial": _radial(proof, cells.parent[at], e.places.reference),
        }
    # The boundary: tractions in Legendre polynomials, per t of the side and times the measure.
    side = np.flatnonzero(~cells.inner)
    numbers, _ = proof.dual.multipliers.of(side)
    moments = proof.dual.given.moments(proof.dual.multipliers)
    traction = moments[numbers].reshape(len(side), 2, -1)
    position = np.full(len(cells.ends) + 1, -1)  # the last one where no side is faced
    position[side] = np.arange(len(side))
    return arrays | {
        "degree": np.array(k),
        "lattice": lattice,
        "stress": measure * T,
        "force": measure * force,
        "side_vertices": cells.ends[side],
        "side_held": proof.dual.given.held[side],
        "side_traction": traction * np.sqrt(2 * np.arange(traction.shape[2]) + 1),
        "contact_side": _joined([position[f.side] for f in lines], int),
        "contact_other": _joined([position[f.other] for f in lines], int),
        "contact_turned": _joined([f.there[:, -1] < f.there[:, 0] for f in lines], bool),
        "contact_direction": _joined([f.direction[:, 0] for f in lines]),
        "contact_weight": _joined([f.weight / WEIGHTS @ TO_ENDS.T for f in lines]),
        "contact_equality": _joined([np.full(len(f.side), f.equality) for f in lines], bool),
        "contact_gap": _joined([f.lifted_gap for f in lines]),
        "contact_pressure": _joined(stress.pressure),
    }


def _joined(parts: Sequence[np.ndarray], kind: type = float) -> np.ndarray:
    return np.concatenate(parts).astype(kind) if parts else np.zeros(0, kind)


class Guaranteed(Estimated):
    """Members of `Solution` that bound its error, made when the first of them is asked for."""

    @cached_property
    def _bound(self) -> Proof:
        space = self.discrete.space
        space.require_mesh()
        self.work["equilibrations"] += 1
        return error_bound(self.problem, space.trace, self.displacement, self.pairs)

    @property
    def bounded(self) -> bool:
        """Whether the bound has been made already."""
        return "_bound" in self.__dict__

    @property
    def error_bound(self) -> float:
        """Upper bound of A(u - u_h, u - u_h)^(1/2), root of an energy per unit thickness.

        u is the solution on the domain of the mesh. Proved by an equilibrated stress, but for
        round-off and for data that are no polynomials, which are looked at in points of quadrature.

        Raises
        ------
        ValueError
            A problem for which no bound is known.
        """
        return self._bound.bound

    @property
    def relative_error_bound(self) -> float:
        """`error_bound` over the energy norm of u_h, dimensionless; 0 where both vanish.

        With initial strains over the norm of the stress, of e(u_h) - e0.
        """
        return self._relative(self.error_bound)

    @property
    def bound_parts(self) -> dict[str, float]:
        """Terms of the square of the bound, each an energy per thickness.

        `constitutive`: |s - sigma_h|^2 of the equilibrated stress s; `complementarity`: twice the
        integral of p* times the gap; `lifting`: what correcting u_h on Gamma_u and Gamma_K costs;
        `loads`: what no polynomial meets of loads, also on curved boundaries.
        """
        return self._bound.parts

    @property
    def energy_bounds(self) -> tuple[float, float]:
        """Energies per unit thickness between which L(u) of HH81 (2.6) lies."""
        space, u = self.discrete.space, self.displacement
        if self.problem.force or self.problem.traction:
            space.require_mesh()
            space = replace(space, f=load_vector(self.problem, space.V, WORK_BONUS))
        energy = potential_energy(self.problem, space, u)
        noise = ENERGY_ROUND_OFF * (self.energy_norm**2 + abs(energy))
        return energy - self._bound.below - noise, energy + self._bound.above + noise

    @property
    def equilibrated(self) -> EquilibratedStress:
        """The stress that proves the bound, in equilibrium with the loads; units of stress."""
        return EquilibratedStress(self._bound)
