"""A bar of the contact force that is proved: docs/bounds.md has the proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...fem import model_of
from .bound import Proof, largest
from .facing import PLACES, Facing, bernstein, fitted, jump, met, on_segments
from .lifting import lifted
from .program import Balanced

NOISE = 1e-13  # of a jump, relative to the largest displacement
LEAST = 3  # degree of w on these: higher ones take 2 % off the bar and twice the time
TWICE = 2.0  # times the least M / B, up to which kappa may grow: the bar does by 5 / 4 at most


@dataclass(frozen=True, eq=False)
class Tested:
    """A displacement G that tests one component of one contact force.

    Attributes
    ----------
    displacement : ng.GridFunction
        G, without a unit: [G] = d.e at the active points of the pair, 0 at those of others.
    directions : sequence of ndarray (2,)
        e on the pair, 0 on the others.
    """

    displacement: ng.GridFunction
    directions: Sequence[Array]


def force_bar(displacement: ng.GridFunction, tested: Tested, proof: Proof) -> float:
    """How far the tested component of a contact force is from the true one, at most.

    Loads and stiffness count as they are integrated. A force per unit thickness.

    Raises
    ------
    ValueError, ContactError
        No bar is proved.
    """
    cells, B, p, lines = proof.cells, proof.bound, proof.stress.pressure, proof.program.lines
    excess = _excess(proof, tested)
    c = [_coefficients(cells.ends[f.side], f, x) for f, x in zip(lines, excess, strict=True)]
    bare = [_least_kappa(cells.ends[f.side], f, x) for f, x in zip(lines, c, strict=True)]
    kappa = max(*bare, _ratio_beside(proof, displacement, tested))
    if not kappa < np.inf:
        raise ValueError(
            "no bar of the force is proved where supports end contact, or an open gap is 0"
        )
    problem = proof.given.problem
    strain = model_of(problem).strain(tested.displacement)
    elements = [e.of_strain(e.places.evaluate(cells, strain)) for e in proof.elements]
    given, moments = replace(proof.given, loads={}), np.zeros_like(proof.moments)
    test = replace(proof, given=given, elements=elements, moments=moments)
    found = _within(test, np.inf)
    t = test.admissible(displacement, found)
    costless = float(np.linalg.norm(t.distance + t.loads)) / B if B > 0 else 0.0
    limit = max(kappa, TWICE * costless)
    if _largest(test, found) > limit:
        found = _within(test, limit, found)
        t = test.admissible(displacement, found)
    kappa = max(kappa, costless, _largest(test, found))
    # What of [G] - d.e is more than kappa times the gap after its own lifting.
    kept = [np.clip(x, -kappa * f.after, kappa * f.after) for f, x in zip(lines, c, strict=True)]
    r = [x - y @ bernstein(y.shape[1] - 1, PLACES).T for x, y in zip(excess, kept, strict=True)]
    held = [replace(one, amount=np.zeros_like(one.amount)) for one in proof.asked]
    w = lifted(
        problem, cells, held, [*zip(lines, r, strict=True)], max(cells.trace.order, LEAST), 1.0
    )
    M = float(np.linalg.norm(t.distance + t.loads + w))
    # The largest M e + kappa (X + Y) with e^2 + 2 X + 2 Y <= B^2.
    error = M * B if M >= kappa * B else (M**2 / kappa + kappa * B**2) / 2
    opened = sum(float((f.force(x) * y).sum()) for f, x, y in zip(lines, p, r, strict=True))
    crossed = float((proof.stress.distance + proof.stress.loads) @ w)
    # What holds free motions does work on G.
    idle = proof.stress.idle and proof.stress.idle * largest(elements, cells, tested.displacement)
    return error + abs(t.work) + crossed + abs(opened) + idle


def _within(test: Proof, kappa: float, start: Balanced | None = None) -> Balanced:
    """The stress near to that of G with |q*| <= kappa p*; any q* where forces have any sign."""
    limits = [
        np.full_like(p, np.inf) if line.equality else np.where(p > 0, kappa, 0) * p
        for line, p in zip(test.program.lines, test.stress.pressure, strict=True)
    ]
    return test.program.nearest(test.elements, test.moments, limits, start)


def _largest(test: Proof, found: Balanced) -> float:
    """The largest |q*| / p*, where forces have one sign."""
    lines = zip(test.program.lines, found.pressure, test.stress.pressure, strict=True)
    ratios = [np.abs(q[p > 0]) / p[p > 0] for x, q, p in lines if not x.equality]
    return max((float(ratio.max(initial=0.0)) for ratio in ratios), default=0.0)


def _excess(proof: Proof, tested: Tested) -> list[Array]:
    """[G] - d.e (k, j) on each line at Gauss points, 0 where it is round-off."""
    cells, found, pairs = proof.cells, [], iter(tested.directions)
    for f in proof.program.lines:
        e = np.zeros(2) if f.pair is None else next(pairs)
        other, there = on_segments(cells, f.other, f.there)
        opposite = np.where(f.other >= 0, other, -1)[:, None].repeat(len(PLACES), 1), there
        G, _ = jump(cells.trace, tested.displacement, on_segments(cells, f.side, PLACES), opposite)
        value = ((G - e) * f.direction).sum(axis=2)
        found.append(np.where(np.abs(value) <= NOISE, 0.0, value))
    return found


def _coefficients(ends: Index, f: Facing, values: Array) -> Array:
    """Bernstein coefficients (k, degree + 1) near to `values` (k, j), one number at a vertex.

    `ends` (k, 2) are the vertices of the sides.
    """
    c, _ = fitted(values, f.after.shape[1] - 1)
    c[np.abs(c) <= NOISE] = 0.0
    _, number, count = np.unique(ends, return_inverse=True, return_counts=True)
    number = number.reshape(-1, 2)
    mean = np.bincount(number.ravel(), c[:, [0, -1]].ravel(), len(count)) / count
    c[:, [0, -1]] = mean[number]
    return np.asarray(c)


def _least_kappa(ends: Index, f: Facing, c: Array) -> float:
    """The least kappa with which nothing is left at vertices that no closed side shares.

    `ends` (k, 2) are the vertices of the sides, `c` (k, degree + 1) coefficients of the jump.
    """
    c, room = np.abs(c[:, [0, -1]]), f.after[:, [0, -1]]
    bare = ~np.isin(ends, ends[f.closed]) & (c > 0)
    ratio = np.divide(c, room, out=np.full_like(c, np.inf), where=room > 0)
    return float(ratio[bare].max(initial=0.0))


def _ratio_beside(proof: Proof, displacement: ng.CoefficientFunction, tested: Tested) -> float:
    """The largest ratio of [G] - d.e to the gap where p* does not act, at Gauss points."""
    cells, ratio = proof.cells, 0.0
    lines = [f for f in proof.program.lines if f.pair is not None]
    for f, e in zip(lines, tested.directions, strict=True):
        assert f.pair is not None
        side = np.setdiff1d(np.flatnonzero(np.isin(cells.segment, f.pair.line.segments)), f.side)
        place = on_segments(cells, side, PLACES)
        found = met(cells.trace, displacement, f.pair, *place)
        G, _ = jump(cells.trace, tested.displacement, place, (found.segment, found.s))
        excess = np.abs(((G - e) * found.direction).sum(axis=2))
        some = found.faces & (excess > NOISE)
        room = np.maximum(found.gap[some], np.finfo(float).tiny)
        ratio = max(ratio, float((excess[some] / room).max(initial=0.0)))
    return ratio
