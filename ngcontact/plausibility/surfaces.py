"""What may be wrong with pairs of solids: directions, gaps, large strains."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..contact import ContactState
from ..fem import BoundaryTrace
from ..solved import Solved
from .pairs import (
    FORCE_SHARE,
    INCLINED,
    LARGE_PRESSURE,
    Doubts,
    contradicted,
    inclined_message,
    large_strain_message,
    softer_in_compression,
)


def doubts_of_surfaces(solution: Solved) -> Doubts:
    """What may be wrong with a solution of solids, pair by pair; see `pairs.doubts`."""
    trace, found = solution.discrete.space.trace, Doubts()
    for number, state in enumerate(solution.pairs):
        name = f"contact {number} of {state.line.contact.named()}"
        messages = {"strain": _large_strains(solution, trace, state)}
        if not messages["strain"]:
            messages["direction"] = _inclined(trace, state)
            messages["gap"] = contradicted(trace, state) if state.active.any() else ""
        found |= {(what, number): f"{name}: {text}" for what, text in messages.items() if text}
    return found


def _large_strains(solution: Solved, trace: BoundaryTrace, state: ContactState) -> str:
    """Message where the mean pressure leaves strains that are not small, or nothing."""
    area = float(state.line.weight[state.active].sum())
    pressure = float(np.abs(state.force).sum()) / area if area else 0.0
    modulus = softer_in_compression(solution.problem, trace, state) if pressure else 0.0
    return large_strain_message(pressure, modulus) if pressure > LARGE_PRESSURE * modulus else ""


def _inclined(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where surfaces that carry force are inclined to the fixed direction, or nothing."""
    if state.line.contact.direction is None or not state.active.any():
        return ""
    angle, force = inclinations(trace, state), np.abs(state.force)
    if force[angle > INCLINED].sum() <= FORCE_SHARE * force.sum():
        return ""
    return inclined_message(state.line.contact, angle)


def inclinations(trace: BoundaryTrace, state: ContactState) -> Array:
    """Angles (m,) in radians between a pair's fixed direction and the surfaces; 0 where open.

    The smaller one of both surfaces, of each the normal that is nearest to the direction.
    """
    line, xi = state.line, np.array(state.line.contact.direction)
    cosine = np.full(len(state.active) + 1, -1.0)
    normal = trace.exact_normal(*trace.at_nodes(line.segments))
    np.maximum.at(cosine, line.rows.ravel(), normal @ xi)
    cosine = cosine[:-1]
    met = np.flatnonzero(line.partner >= 0)
    there = -trace.exact_normal(line.partner[met], line.partner_s[met]) @ xi
    cosine[met] = np.maximum(cosine[met], there)
    return np.where(state.active, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
