"""The parts of a bound, and their sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .data import Partition, Units, legendre_values
from .liftings import EdgeField, Opened, at_points, coefficients
from .proofs import Norms
from .stress import EquilibratedStress


@dataclass(frozen=True, eq=False)
class ErrorBound:
    """What is proved about one discrete solution; energies per unit thickness.

    Attributes
    ----------
    bound : float
        B: at least the energy norm of the error, root of an energy.
    parts : dict of float
        Its squared parts: constitutive, complementarity, lifting, loads, curves.
    below, above : float
        Energies: L(u_h) - below <= L(u) <= L(u_h) + above.
    stress : EquilibratedStress
        The stress that proves it.
    """

    bound: float
    parts: dict[str, float]
    below: float
    above: float
    stress: EquilibratedStress


def work_of_supports(fields: Sequence[EdgeField], partition: Partition, traction: Array) -> float:
    """Work of s n on the `fields` u_D - u_h; `traction` (n, 3, r) on the edges of triangles."""
    work = 0.0
    for field in fields:
        triangle, side = (x[field.edge] for x in partition.owner)
        t = traction[triangle, side].reshape(len(triangle), 2, -1)
        values = legendre_values(t.shape[2] - 1, field.t.ravel()).reshape(*field.t.shape, -1)
        density = np.einsum("kqi,kci,kqc->kq", values, t, field.value)
        work += float(partition.edge_lengths[field.edge] @ (field.weight * density).sum(axis=1))
    return work


def summed(
    units: Units,
    norms: Norms,
    closed: float,
    signed: float,
    reaction: float,
    stress: EquilibratedStress,
) -> ErrorBound:
    """All parts together, in the units of the data.

    `closed` is the integral of p* (gap_h + r), `signed` that of p* gap_h, `reaction` the work of
    s n on u_D - u_h.
    """
    energy = units.energy
    constitutive, lifting, loads = norms.constitutive, norms.lifting, norms.loads + norms.curves
    smooth = constitutive + norms.loads
    both = constitutive + loads
    parts = {
        "constitutive": float(constitutive @ constitutive),
        "complementarity": 2 * closed,
        "lifting": float(lifting @ lifting),
        "loads": float(smooth @ smooth - constitutive @ constitutive),
        "curves": float(both @ both - smooth @ smooth),
    }
    of_elements = norms.partition.of_elements
    crossed, worked = (float(of_elements(x) @ lifting) for x in (constitutive, loads))
    data = float(loads @ constitutive + loads @ loads / 2) + 2 * worked
    below = parts["constitutive"] / 2 + signed - reaction + data
    above = crossed + reaction + closed - signed + parts["lifting"] / 2 + worked
    return ErrorBound(
        bound=norms.bound(closed, units),
        parts={name: part * energy for name, part in parts.items()},
        below=below * energy,
        above=above * energy,
        stress=stress,
    )


def complementarity(gap: Opened, b: Array) -> tuple[float, float]:
    """Integrals of p*, of coefficients `b` (m,), times the gap after lifting, and before."""
    zone, pieces = gap.zone, gap.pieces
    at = np.flatnonzero((zone.number[pieces.local] >= 0).any(axis=1))
    if at.size == 0:
        return 0.0, 0.0
    t, w = gap.panels(at)
    value, r, _ = gap.lifted(at, t)
    s = pieces.start[at, None] + (pieces.stop - pieces.start)[at, None] * t
    p = (zone.values(np.repeat(pieces.local[at], t.shape[1]), s.ravel()) @ b).reshape(t.shape)
    # ds or d eta per parameter; on curves no polynomial, but nearly
    stretch = coefficients(gap.points.weight.reshape(len(pieces.local), -1)[at])
    density = at_points(stretch, t) * w * p
    return float((density * (value + r)).sum()), float((density * value).sum())
