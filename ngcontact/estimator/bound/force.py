"""A bar of the contact force that is proved: docs/bounds.md has the proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...fem import model_of
from .bound import Proof, largest
from .cells import Cells
from .facing import POINTS, FacingSides, bernstein, fitted, jump, opposite_points
from .lifting import lifted

JUMP_NOISE = 1e-13  # of a jump, relative to the largest displacement
LIFTING_DEGREE = 3  # degree of w on these: higher ones take 2 % off the bar and twice the time
KAPPA_GROWTH = 2.0  # times the least M / B, up to which kappa may grow: the bar does by 5 / 4


def force_bar(
    proof: Proof, displacement: ng.GridFunction, G: ng.GridFunction, directions: Sequence[Array]
) -> float:
    """Bound of the error of a component of a contact force.

    Loads and stiffness count as they are integrated. A force per unit thickness.

    Parameters
    ----------
    proof : Proof
    displacement, G : ng.GridFunction
        u_h, and G, without a unit: [G] = d.e at the active points of the pair, 0 at those of
        others.
    directions : sequence of ndarray (2,)
        e on the pair, 0 on the others.

    Raises
    ------
    ValueError, ContactError
        No bar is proved.
    """
    dual, stress, B = proof.dual, proof.stress, proof.bound
    cells, lines, kappa = dual.cells, dual.lines, 0.0
    excess = []
    for f, e in zip(lines, [*directions, np.zeros(2)], strict=False):  # 0 on guides, the last
        excess.append(_excess(cells, G, f, e))
        kappa = max(kappa, _bare(f, excess[-1][1]), _beside(cells, displacement, G, f, e))
    if not kappa < np.inf:
        raise ValueError(
            "no bar of the force is proved where supports end contact, or an open gap is 0"
        )
    problem = proof.problem
    test = dual.of_strain(model_of(problem).strain(G))
    t = test.nearest(
        pressed=stress.force,
        limit=lambda size: max(kappa, KAPPA_GROWTH * size / B if B > 0 else 0.0),
    )
    pressed = ~test.program.equality & (stress.force > 0)
    ratio = np.abs(t.force[pressed] / stress.force[pressed]).max(initial=0.0)
    # Up to M / B kappa costs nothing.
    kappa = max(kappa, float(ratio), t.size / B if B > 0 else 0.0)
    # What of [G] - d.e is more than kappa times the gap after its own lifting.
    r = []
    for f, (x, y) in zip(lines, excess, strict=True):
        y = np.clip(y, -kappa * f.lifted_gap, kappa * f.lifted_gap)
        r.append(x - y @ bernstein(y.shape[1] - 1, POINTS).T)
    held = [replace(one, amount=np.zeros_like(one.amount)) for one in dual.prescribed]
    degree, lifts = max(cells.trace.order, LIFTING_DEGREE), list(zip(lines, r, strict=True))
    w = lifted(problem, cells, held, lifts, degree, 1.0)
    M = float(np.linalg.norm(t.distance + t.loads + w))
    # The largest M e + kappa (X + Y) with e^2 + 2 X + 2 Y <= B^2.
    error = M * B if M >= kappa * B else (M**2 / kappa + kappa * B**2) / 2
    each = zip(lines, stress.pressure, r, strict=True)
    opened = sum(float((f.force(p) * opening).sum()) for f, p, opening in each)
    crossed = float((stress.distance + stress.loads) @ w)
    on_motions = stress.free_force and stress.free_force * largest(test.elements, G)
    return error + abs(t.work) + crossed + abs(opened) + on_motions


def _excess(cells: Cells, G: ng.GridFunction, f: FacingSides, e: Array) -> tuple[Array, Array]:
    """[G] - d.e (k, j) on a line at Gauss points, 0 where it is round-off.

    And Bernstein coefficients (k, degree + 1) near to it, one number at a vertex.
    """
    ends = cells.ends[f.side]
    other, there = cells.on_side(f.other, f.there)
    other = np.where(f.other >= 0, other, -1)[:, None].repeat(len(POINTS), 1)
    values, _ = jump(cells.trace, G, cells.on_side(f.side, POINTS[None]), (other, there))
    excess = ((values - e) * f.direction).sum(axis=2)
    excess[np.abs(excess) <= JUMP_NOISE] = 0.0
    c, _ = fitted(excess, f.lifted_gap.shape[1] - 1)
    c[np.abs(c) <= JUMP_NOISE] = 0.0
    count, total = np.zeros((2, len(cells.vertices)))
    np.add.at(count, ends, 1.0)
    np.add.at(total, ends, c[:, [0, -1]])
    c[:, [0, -1]] = total[ends] / count[ends]
    return excess, c


def _bare(f: FacingSides, c: Array) -> float:
    """The least kappa with which nothing of `c` is left at vertices that no closed side shares."""
    room, size = f.lifted_gap[:, [0, -1]], np.abs(c[:, [0, -1]])
    ratio = np.divide(size, room, out=np.full_like(room, np.inf), where=room > 0)
    return float(ratio[~f.touched & (size > 0)].max(initial=0.0))


def _beside(
    cells: Cells, displacement: ng.GridFunction, G: ng.GridFunction, f: FacingSides, e: Array
) -> float:
    """The largest ratio of [G] - d.e to the gap where p* does not act, at Gauss points."""
    trace, side = cells.trace, np.setdiff1d(cells.sides_on(f.pair.line.segments), f.side)
    place = cells.on_side(side, POINTS[None])
    found = opposite_points(trace, displacement, f.pair, *place)
    values, _ = jump(trace, G, place, (found.segment, found.s))
    excess = np.abs(((values - e) * found.direction).sum(axis=2))
    some = found.faces & (excess > JUMP_NOISE)
    room = np.maximum(found.gap[some], np.finfo(float).tiny)
    return float((excess[some] / room).max(initial=0.0))
