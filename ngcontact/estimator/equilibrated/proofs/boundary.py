"""Tractions on curves and on Gamma_K, p* and the gap, as arrays of a certificate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....arrays import Array
from ..guides import Reactions
from ..liftings import at_points, coefficients
from ..pressures import SLIVER
from ..remainders import Strip
from .record import Proof


def strip_arrays(proof: Proof) -> dict[str, Array]:
    """Tractions asked for at points of edges, less p*, and by what p* is multiplied in them.

    By name, (k, q) of k strips. Places run from vertex i + 1 to i + 2 of the triangle; pieces are
    counted over all pairs.
    """
    if not proof.strips:
        return {}
    partition = proof.discrete.partition
    count = [len(gap.pieces.local) for gap in proof.gaps]
    parts: list[dict[str, Any]] = []
    for strip in proof.strips:
        triangle, side = (x[strip.edge] for x in partition.owner)
        own = (strip.piece < 0)[:, None, None]
        parts.append(
            {
                "strip_triangle": triangle,
                "strip_side": side,
                "strip_place": np.where(
                    partition.flips[triangle, side][:, None], 1 - strip.t, strip.t
                ),
                "strip_weight": strip.weight,
                "strip_load": np.where(own, strip.asked, 0.0) * proof.units.traction,
                "strip_counts": strip.counts,
                "strip_piece": np.where(own[:, 0, 0], -1, sum(count[: strip.pair]) + strip.piece),
                "strip_s": _in_reach(proof, strip),
                "strip_action": strip.action * (proof.units.traction / proof.units.stress),
            }
        )
    return _joined(parts)


def contact_arrays(proof: Proof) -> dict[str, Array]:
    """p* on the pieces of all pairs and guides, and the gap there, by parameters of where it acts.

    By name: (k, d + 1) coefficients of k pieces, (q,) at points of all of them.
    """
    units, before = proof.units, 0
    parts: list[dict[str, Any]] = []
    for number, (gap, b) in enumerate(zip(proof.gaps, proof.pressures, strict=True)):
        pieces, every = gap.pieces, np.arange(len(gap.pieces.local))
        if every.size == 0:
            continue
        reach = gap.zone.reach
        ends = reach.places(pieces.local, np.column_stack([pieces.start, pieces.stop]))
        beyond = (ends[:, 0] < -SLIVER) | (ends[:, 1] > 1 + SLIVER)  # p* is 0 there
        p = np.append(b, 0.0)[np.where(beyond[:, None], -1, gap.zone.number[pieces.local])]
        t, w = gap.panels(every)
        value, r, _ = gap.lifted(every, t)
        stretch = coefficients(gap.points.weight.reshape(len(every), -1))
        place = pieces.start[:, None] + (pieces.stop - pieces.start)[:, None] * t
        opened = np.maximum(value + r, 0.0) * units.strain * units.length
        contact = pieces.line.contact
        parts.append(
            {
                "contact_pair": np.full(len(every), number),
                "contact_pressure": p * units.stress,
                "contact_unilateral": np.full(len(every), not contact.bilateral),
                "contact_obstacle": np.full(len(every), contact.primary is None),
                "gap_piece": np.repeat(before + every, t.shape[1]),
                "gap_s": reach.places(pieces.local, place).ravel(),
                "gap_weight": (at_points(stretch, t) * w).ravel() * units.measure,
                "gap_open": opened.ravel(),
            }
        )
        before += len(every)
    if proof.guides is not None:
        parts.append(_guide_arrays(proof, proof.guides, before))
    degree = max((part["contact_pressure"].shape[1] for part in parts), default=0) - 1
    for part in parts:
        part["contact_pressure"] = _elevated(part["contact_pressure"], degree)
    return _joined(parts)


def _elevated(b: Array, degree: int) -> Array:
    """Coefficients (k, degree + 1) of the Bernstein polynomials that `b` (k, d + 1) are of."""
    for d in range(b.shape[1], degree + 1):
        share = np.arange(d + 1) / d
        wide = np.pad(b, ((0, 0), (1, 1)))
        b = share * wide[:, :-1] + (1 - share) * wide[:, 1:]
    return b


def _guide_arrays(proof: Proof, guides: Reactions, before: int) -> dict[str, Any]:
    """The same of q* on turning guides, which is bilateral contact with an obstacle."""
    strip, k = guides.strip, len(guides.strip.edge)
    length = proof.discrete.partition.edge_lengths[strip.edge] * proof.units.measure
    weight = length[:, None] * strip.weight * np.linalg.norm(strip.action, axis=2)
    return {
        "contact_pair": np.full(k, strip.pair),
        "contact_pressure": guides.coefficients * proof.units.stress,
        "contact_unilateral": np.zeros(k, dtype=bool),
        "contact_obstacle": np.ones(k, dtype=bool),
        "gap_piece": np.repeat(before + np.arange(k), strip.t.shape[1]),
        "gap_s": strip.t.ravel(),
        "gap_weight": weight.ravel(),
        "gap_open": np.zeros(strip.t.size),
    }


def _in_reach(proof: Proof, strip: Strip) -> Array:
    """Parameters (k, q) of a strip by which p* is a polynomial."""
    if not 0 <= strip.pair < len(proof.gaps):
        return strip.s
    gap = proof.gaps[strip.pair]
    return gap.zone.reach.places(gap.pieces.local[strip.piece], strip.s)


def _joined(parts: Sequence[dict[str, Any]]) -> dict[str, Array]:
    return (
        {name: np.concatenate([part[name] for part in parts]) for name in parts[0]} if parts else {}
    )
