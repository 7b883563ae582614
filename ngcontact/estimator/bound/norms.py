"""Norms of stresses, forces and residuals by triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .cells import Cells
from .elements import Element, Multipliers

SETTLED = 1e-10  # residual of equilibrium, relative to the largest stress


@dataclass(frozen=True, eq=False)
class StressNorms:
    """A stress s on n triangles, beside that of a displacement of strain e.

    Attributes
    ----------
    distance : ndarray (n,)
        |s - C e|, roots of energies per thickness.
    largest : float
        Largest component of s, a stress.
    """

    distance: Array
    largest: float


def stress_norms(elements: Sequence[Element], coefficients: Sequence[Array], n: int) -> StressNorms:
    """Norms of a stress on the n triangles of `elements`.

    Parameters
    ----------
    coefficients : sequence of ndarray (b, m)
        Of the stress on the triangles of each element.
    """
    distance, largest = np.zeros(n), 0.0
    for e, c in zip(elements, coefficients, strict=True):
        s = e.whole_stress(c)
        strain = (e.compliance @ s[..., None])[..., 0] - e.strain
        stress = (np.linalg.inv(e.compliance) @ strain[..., None])[..., 0]
        energy = (e.weight * (strain * stress).sum(axis=2)).sum(axis=1)
        distance[e.places.at] = np.sqrt(energy)
        largest = max(largest, float(np.abs(s).max()))
    return StressNorms(distance, largest)


def forces_missed(elements: Sequence[Element], n: int) -> Array:
    """`Element.missed` (n,) of all triangles: L2 norms of forces that stresses do not balance."""
    missed = np.zeros(n)
    for e in elements:
        missed[e.places.at] = e.missed
    return missed


def smallest_moduli(elements: Sequence[Element], n: int) -> Array:
    """Smallest eigenvalue (n,) of C in Mandel's scaling, a stress."""
    found = np.zeros(n)
    for e in elements:
        mandel = np.ones(e.compliance.shape[-1])
        mandel[-1] = 0.5**0.5
        scaled = e.compliance * mandel * mandel[:, None]
        found[e.places.at] = 1 / np.linalg.eigvalsh(scaled)[..., -1].max(axis=1)
    return found


def residuals(cells: Cells, mu: Multipliers, left: Array, largest: float) -> Array:
    """Largest moment `left` (d,) without balance on the sides of each triangle, (n,).

    Dimensionless: over the diameter of the side's owner, the measure and the `largest` stress.
    """
    middle = cells.vertices[cells.ends].mean(axis=1)
    size = cells.diameters[cells.owner] * cells.trace.model.measure(middle) * (largest or 1.0)
    force = np.maximum.reduceat(np.abs(left), mu.start[:-1])
    return np.divide(force, size, out=np.zeros_like(size), where=size > 0)[cells.sides].max(axis=1)
