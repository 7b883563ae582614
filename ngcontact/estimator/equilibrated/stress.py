"""An equilibrated stress: its coefficients, its certificate."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from .data import Discrete, EdgeConditions, dimension
from .proofs import Proof, certificate_arrays
from .stresses import (
    Equilibrated,
    closed,
    equilibrated,
    improved,
    into_raw,
    raw_operators,
    stress_field,
)

SETTLED = 1e-10  # residual of equilibrium, relative to the largest stress: measured 1e-15 to 1e-12
CLOSED = 1e-12  # ... above which what is missed is balanced once more
PASSES = 3


@dataclass(frozen=True, eq=False)
class ContactPressure:
    """p* of one pair.

    Attributes
    ----------
    segments : ndarray of int (k,)
        Segments of the boundary of the mesh, the secondary's.
    coefficients : ndarray (k, d + 1)
        Of Bernstein polynomials from one end of each segment to the other, units of stress; per
        unit length (P1), per unit eta (P2).
    """

    segments: Index
    coefficients: Array


@dataclass(frozen=True, eq=False)
class EquilibratedStress:
    """A stress in equilibrium with the loads on n triangles.

    Attributes
    ----------
    degree : int
        Of its polynomials.
    triangles : ndarray (n, 3, 2)
        Corners of the triangles, lengths.
    element : ndarray of int (n,)
        Elements of the mesh that they are, or parts of.
    coefficients : ndarray (n, 3, m)
        (xx, yy, xy) in the m orthonormal polynomials on each triangle, units of stress; about an
        axis of the stress times 2 pi r.
    pressure : list of ContactPressure
        p* of each pair.
    certificate : dict of float
        Largest residuals of divergence (times diameter), jumps and given tractions, relative to the
        largest stress; the least p*, in units of stress.
    proof : Proof
        What it was made of.
    """

    degree: int
    triangles: Array
    element: Index
    coefficients: Array
    pressure: list[ContactPressure]
    certificate: dict[str, float]
    proof: Proof

    @cached_property
    def stress(self) -> ng.CoefficientFunction:
        """The stress in the plane, (2, 2), in units of stress."""
        mesh = self.proof.discrete.partition.mesh
        T = stress_field(mesh, self.triangles, self.element, self.coefficients, self.degree)
        return self.proof.discrete.balance.stress(T)

    def at_middles(self) -> Array:
        """Stress in the middles of the triangles, units of stress.

        (xx, yy, xy), (n, 3), or (rr, zz, rz, hoop) about an axis, (n, 4).
        """
        discrete, raw = self.proof.discrete, self.proof.raw
        values = discrete.balance.in_middles(discrete.partition, raw, discrete.radial)
        return values * self.proof.units.stress

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write `path` (.npz): arrays that drivers/check_certificate.py checks with NumPy alone."""
        path = Path(path)
        if path.suffix != ".npz":
            raise ValueError(f'path="{path}" must end in .npz')
        arrays: dict[str, Any] = dict(certificate_arrays(self.proof))
        np.savez_compressed(path, **arrays)
        return path


def raw_coefficients(discrete: Discrete, result: Equilibrated, at: Index) -> Array:
    """Coefficients (b, 3, m) of the equilibrated stress on triangles `at` (b,)."""
    c = (into_raw(discrete, at) @ result.change[at][:, :, None]).reshape(len(at), 3, -1)
    smooth, rough = np.arange(len(at)), discrete.rough
    if rough is not None:
        number = rough.number[at]
        smooth, here, number = (number < 0).nonzero()[0], number >= 0, number[number >= 0]
        hatted = rough.hatted[number].sum(axis=1)[:, :, None]
        c[here] += (rough.into[number] @ hatted).reshape(len(number), 3, c.shape[2])
    c[smooth, :, : discrete.stress.shape[-1]] += discrete.stress[at[smooth]]
    return c


@dataclass(frozen=True, eq=False)
class Certified:
    """A stress in equilibrium on n triangles, and how nearly.

    Attributes
    ----------
    found : Equilibrated
        The stress.
    raw : ndarray (n, 3, m)
        Its coefficients.
    traction : ndarray (n, 3, r)
        Its tractions on the edges.
    missing : ndarray (e, r)
        What these have too much, summed over the triangles of each edge.
    residuals : dict of float
        Of divergence, jumps and given tractions, relative to the largest stress.
    """

    found: Equilibrated
    raw: Array
    traction: Array
    missing: Array
    residuals: dict[str, float]

    @property
    def worst(self) -> float:
        """The largest of the residuals."""
        return max(self.residuals.values())


def settled(discrete: Discrete, conditions: EdgeConditions, given: Array) -> Certified:
    """The stress of all patches for tractions `given` (e, 2, r), to round-off in equilibrium."""
    nearest = improved(discrete, conditions, equilibrated(discrete, conditions, given))
    best = certified(discrete, conditions, given, nearest)
    for _ in range(PASSES):
        if max(best.residuals["jumps"], best.residuals["tractions"]) <= CLOSED:
            break
        again = closed(discrete, conditions, best.found, best.missing)
        other = certified(discrete, conditions, given, again)
        if other.worst >= best.worst:
            break
        best = other
    return best


def certified(
    discrete: Discrete, conditions: EdgeConditions, given: Array, result: Equilibrated
) -> Certified:
    """How nearly a stress is in equilibrium with tractions `given` (e, 2, r), of contact, too."""
    partition, k = discrete.partition, discrete.degree
    n, m = len(partition.triangles), dimension(k)
    coefficients, traction = np.empty((n, 3, m)), np.empty((n, 3, 2 * (k + 1)))
    force, unbalanced = discrete.force.sum(axis=1), np.empty(n)
    if discrete.rough is not None:
        force[discrete.rough.at] = discrete.rough.force
    asked = force[:, discrete.balance.equations].reshape(n, -1)
    step = max(1, 1_000_000 // (9 * m * m))
    for start in range(0, n, step):
        at = np.arange(start, min(start + step, n))
        c = coefficients[at] = raw_coefficients(discrete, result, at)
        D, N = raw_operators(discrete, at, conditions.frames)
        flat = c.reshape(len(at), -1, 1)
        rest = np.abs((D @ flat)[..., 0] + asked[at]).max(axis=1)
        unbalanced[at] = rest * partition.diameters[at]
        traction[at] = (N @ flat).reshape(len(at), 3, -1)
    largest = max(np.abs(coefficients).max(initial=0.0), np.finfo(float).tiny)
    total = np.zeros_like(given[:, 0])
    np.add.at(total, partition.edges, traction)
    met = conditions.constrained & ~conditions.soft
    missing = np.where(met, total - given.sum(axis=1), 0.0)
    largest_on = np.abs(missing).max(axis=1)
    inner = partition.segment < 0
    residuals = {
        "divergence": float(unbalanced.max() / largest),
        "jumps": float(largest_on[inner].max(initial=0.0) / largest),
        "tractions": float(largest_on[~inner].max(initial=0.0) / largest),
    }
    return Certified(result, coefficients, traction, missing, residuals)
