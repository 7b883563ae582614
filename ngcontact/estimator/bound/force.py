"""A bar of the contact force that is proved: docs/bounds.md has the proof."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...errors import ContactError
from ...fem import model_of
from ...problem import Problem
from .bound import LIFTED, Proof, work_on_gap
from .facing import PLACES, WEIGHTS, Facing, bernstein, met, on_segments
from .lifting import asked_on_supports, lifted
from .missed import data_norms
from .norms import SETTLED, residuals, smallest_moduli, stress_norms
from .tractions import boundary_tractions

NOISE = 1e-13  # of a jump, relative to the largest displacement
ROOM = 2.0  # largest |q*| / p* over the ratio of their means, where contact has no open end


@dataclass(frozen=True, eq=False)
class Tested:
    """A displacement G that tests one component of one contact force.

    Attributes
    ----------
    displacement : ng.GridFunction
        G, without a unit: [G] = d.e at the active points of the pair, 0 at those of others.
    forces : sequence of ndarray (m,)
        Its nodal contact forces on each pair, force per thickness and length.
    directions : sequence of ndarray (2,)
        e on the pair, 0 on the others.
    """

    displacement: ng.GridFunction
    forces: Sequence[Array]
    directions: Sequence[Array]


def force_bar(
    problem: Problem, displacement: ng.GridFunction, tested: Tested, proof: Proof
) -> float:
    """How far the tested component of a contact force is from the true one, at most.

    Loads and stiffness count as they are integrated. A force per unit thickness.

    Raises
    ------
    ValueError, ContactError
        No bar is proved.
    """
    cells, G = proof.cells, tested.displacement
    n, lines = len(cells.triangles), proof.program.lines
    facing = [line.facing for line in lines]
    ends, excess = [cells.ends[f.side] for f in facing], _jumps(proof, tested)
    kappa = max(
        *(_least_kappa(*x) for x in zip(ends, facing, excess, strict=True)),
        _mean_ratio(proof, tested),
        _ratio_beside(proof, displacement, tested),
    )
    if not math.isfinite(kappa):
        raise ValueError(
            "no bar of the force is proved where supports end contact, or an open gap is 0"
        )
    lift = [_lift(*x, kappa) for x in zip(ends, facing, excess, strict=True)]
    strain = model_of(problem).strain(G)
    elements = [e.of_strain(e.places.evaluate(cells, strain)) for e in proof.elements]
    limits = [
        np.full_like(p, math.inf) if x.facing.equality else kappa * p
        for x, p in zip(lines, proof.balanced.pressure, strict=True)
    ]
    dual = proof.program.within(elements, limits)
    norms = stress_norms(elements, dual.coefficients, n)
    none = np.zeros_like(proof.moments)
    left = proof.program.unbalanced(proof.multipliers, elements, none, dual)
    if not residuals(cells, proof.multipliers, left, norms.largest).max() <= SETTLED:
        raise ContactError("no stress of the force's test was found in equilibrium")
    given = replace(proof.given, loads=[]).under(lines, dual.pressure)
    have = boundary_tractions(given, elements, dual.coefficients)
    missed = have.missed(given, norms.largest)
    data = data_norms(cells, np.zeros(n), missed, smallest_moduli(elements, n))
    held = [
        replace(one, amount=np.zeros_like(one.amount)) for one in asked_on_supports(cells, given, G)
    ]
    lifts = list(zip(facing, lift, strict=True))
    lifting = lifted(problem, cells, held, lifts, cells.trace.order + LIFTED, 1.0)
    M = float(np.linalg.norm(norms.distance + data + lifting))
    B = proof.bound
    # The largest M e + kappa (X + Y) with e^2 + 2 X + 2 Y <= B^2.
    error = M * B if M >= kappa * B else (M**2 / kappa + kappa * B**2) / 2
    work = have.work(given, displacement)
    opened = 0.0
    for line, q, p, r in zip(lines, dual.pressure, proof.balanced.pressure, lift, strict=True):
        work -= work_on_gap(line.facing, q, line.facing.gap)
        opened += work_on_gap(line.facing, p, r)
    crossed = float((proof.stress.distance + proof.loads) @ lifting)
    return error + abs(work) + crossed + abs(opened)


def _jumps(proof: Proof, tested: Tested) -> list[Array]:
    """[G] - d.e (k, j) on each line at Gauss points, 0 where it is round-off."""
    trace, found = proof.cells.trace, []
    pairs = iter(tested.directions)
    for line in proof.program.lines:
        f = line.facing
        k, j = f.there.shape
        e = np.zeros(2) if f.pair is None else next(pairs)
        segment, s = proof.cells.on_side(np.repeat(f.side, j), np.tile(PLACES, k))
        jump = trace.evaluate(tested.displacement, segment, s).reshape(k, j, 2)
        if line.opposite:
            segment, s = proof.cells.on_side(np.repeat(f.other, j), f.there.ravel())
            jump = jump - trace.evaluate(tested.displacement, segment, s).reshape(k, j, 2)
        value = ((jump - e) * f.direction).sum(axis=2)
        found.append(np.where(np.abs(value) <= NOISE, 0.0, value))
    return found


def _coefficients(ends: Index, f: Facing, values: Array) -> Array:
    """Bernstein coefficients (k, degree + 1) near to `values` (k, j), one number at a vertex.

    `ends` (k, 2) are the vertices of the sides.
    """
    B = bernstein(f.after.shape[1] - 1, PLACES) * np.sqrt(WEIGHTS)[:, None]
    c = np.linalg.lstsq(B, (np.sqrt(WEIGHTS) * values).T, rcond=None)[0].T
    c[np.abs(c) <= NOISE] = 0.0
    _, number, count = np.unique(ends, return_inverse=True, return_counts=True)
    number = number.reshape(-1, 2)
    mean = np.bincount(number.ravel(), c[:, [0, -1]].ravel(), len(count)) / count
    c[:, [0, -1]] = mean[number]
    return np.asarray(c)


def _least_kappa(ends: Index, f: Facing, jump: Array) -> float:
    """The least kappa with which nothing is left at vertices that no closed side shares."""
    c = np.abs(_coefficients(ends, f, jump)[:, [0, -1]])
    bare = ~np.isin(ends, ends[f.closed]) & (c > 0)
    room = f.after[:, [0, -1]]
    ratio = np.divide(c, room, out=np.full_like(c, np.inf), where=room > 0)
    return float(ratio[bare].max(initial=0.0))


def _lift(ends: Index, f: Facing, jump: Array, kappa: float) -> Array:
    """What of [G] - d.e (k, j) is more than kappa times the gap after its own lifting."""
    room = kappa * f.after
    kept = np.clip(_coefficients(ends, f, jump), -room, room)
    return np.asarray(jump - kept @ bernstein(kept.shape[1] - 1, PLACES).T)


def _ratio_beside(proof: Proof, displacement: ng.CoefficientFunction, tested: Tested) -> float:
    """The largest ratio of [G] - d.e to the gap where p* does not act, at Gauss points."""
    cells, ratio, j = proof.cells, 0.0, len(PLACES)
    facing = [line.facing for line in proof.program.lines]
    for f, e in zip([f for f in facing if f.pair is not None], tested.directions, strict=True):
        assert f.pair is not None
        beside = np.isin(cells.segment, f.pair.line.segments)
        beside[f.side] = False
        side = np.flatnonzero(beside)
        segment, s = on_segments(cells, side, PLACES)
        found = met(cells.trace, displacement, f.pair, segment, s)
        jump = cells.trace.evaluate(tested.displacement, np.repeat(segment, j), s.ravel())
        jump, at = jump.reshape(*s.shape, 2), found.segment >= 0
        jump[at] -= cells.trace.evaluate(tested.displacement, found.segment[at], found.s[at])
        excess = np.abs(((jump - e) * found.direction).sum(axis=2))
        some = found.faces & (excess > NOISE)
        room = np.maximum(found.gap[some], np.finfo(float).tiny)
        ratio = max(ratio, float((excess[some] / room).max(initial=0.0)))
    return ratio


def _mean_ratio(proof: Proof, tested: Tested) -> float:
    """`ROOM` times the mean of |q| over that of p, of unilateral pairs in contact."""
    pairs = [line.facing.pair for line in proof.program.lines if line.facing.pair is not None]
    ratios = [
        np.abs(force).sum() / pair.force.sum()
        for pair, force in zip(pairs, tested.forces, strict=True)
        if not pair.line.contact.bilateral and pair.force.sum() > 0
    ]
    return ROOM * max(map(float, ratios), default=0.0)
