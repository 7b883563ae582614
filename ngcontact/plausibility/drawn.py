"""Bodies that are drawn apart: normals that turn on the way, gaps of the other sign.

Without a direction the gap is measured along the normals of the secondary as it is drawn (2.3).
On the way g over which a translation closes it, points slide by g theta where their normals are
turned by theta; there the gap has changed by its slope times that way. Between circles of radii R
and S (negative in a hole) the curvature of the gap, on which Hertz's formulas rest, comes out too
large by 2 g / R + g**2 / (R (R + S)), and the peak of the pressure by half of that: by g / R
between discs, by g / (2 R) for a pin that was drawn in the middle of its hole; too small by that
where the hole is the secondary.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index
from ..contact import ContactLine, ContactState, in_contact, twins
from ..fem import BoundaryTrace

# Share of the peak from which it is told. Between two discs whose radii are 1 and 1, 1 and 3, 3 and
# 1 peaks were wrong by 0.93 to 1.05 times what is said here, measured at ways of 0.01 to 0.16; of
# pins with a clearance of 2 to 25 % of their radius by 0.93 to 0.96 times that, of holes as
# secondary, 5 to 25 %, by -1.02 to -1.06 times, at 2 % by half.
FAR = 0.02
# Share of a given gap of one sign from which a drawn one of the other sign contradicts it.
OTHERWISE = 0.5


@dataclass(frozen=True, eq=False)
class Zones:
    """The k connected zones of one pair in which its bodies touch.

    Attributes
    ----------
    number : ndarray of int (m,)
        Zone of each contact point, -1 where the gap is open.
    force, weight : ndarray (k,)
        Sums over the points of each zone: a force per unit thickness, a length.
    segments : ndarray (k,)
        Length in segments: half of the interval between two nodes in which it ends counts.
    ends : ndarray of int (k,)
        Transitions to open points.
    """

    number: Index
    force: Array
    weight: Array
    segments: Array
    ends: Index


def links(line: ContactLine) -> tuple[Index, Index]:
    """Pairs of neighbouring points: (l, 2) on one segment, (t, 2) on both sides of a corner."""
    one, other = line.rows[:, :-1].ravel(), line.rows[:, 1:].ravel()
    both = np.flatnonzero((one >= 0) & (other >= 0))
    return np.array([one[both], other[both]]).T, twins(line)


def connected(count: int, pairs: Index) -> Index:
    """Least number (n,), of a `count` n, to which each is joined by `pairs` (k, 2)."""
    number = np.arange(count)
    while True:
        one, other = number[pairs.T]
        if (one == other).all():
            return number
        low = np.minimum(one, other)
        np.minimum.at(number, one, low)
        np.minimum.at(number, other, low)
        while ((further := number[number]) != number).any():
            number = further


def zones_of(state: ContactState) -> Zones:
    """The zones of one pair."""
    line = state.line
    along, across = links(line)
    closed = in_contact(line, state.active) if len(across) else state.active
    both = np.concatenate([along, across])
    touching = closed[both].sum(axis=1)
    number = connected(len(closed), both[touching == 2])
    first = closed & (number == np.arange(len(closed)))
    k = np.count_nonzero(first)
    number = np.where(closed, (np.cumsum(first) - 1)[number], -1)

    def summed(points: Index, values: Array) -> Array:
        return np.asarray(np.bincount(number[points], values, minlength=k), dtype=float)

    def counted(points: Index) -> Index:
        return np.bincount(number[points], minlength=k)

    at = np.flatnonzero(closed)
    inside, ending = along[touching[: len(along)] == 2], both[touching == 1]
    ends = counted(ending[closed[ending]])
    return Zones(
        number=number,
        force=summed(at, state.force[at]),
        weight=summed(at, line.weight[at]),
        segments=(counted(inside[:, 0]) + ends / 2) / (line.rows.shape[1] - 1),
        ends=ends,
    )


def _curvatures(points: Array, normals: Array, along: Index) -> Array:
    """Curvatures (l,), 1 / length, between neighbours `along` (l, 2) of the `points` (m, 2)."""
    chord, turn = (np.diff(values[along], axis=1)[:, 0] for values in (points, normals))
    length = (chord * chord).sum(axis=1)
    return np.divide((turn * chord).sum(axis=1), length, out=np.zeros(len(along)), where=length > 0)


def way_and_error(trace: BoundaryTrace, state: ContactState) -> tuple[float, float]:
    """Way that closes the gap, a length, and the share by which the peak of pressure is wrong.

    Both in the mean by force; 0 where normals do not turn or the bodies are drawn touching. An
    error of `FAR` or less is a bound of what it is.
    """
    line, force = state.line, np.abs(state.force)
    along, _ = links(line)
    weight = force[along].sum(axis=1)
    if not weight.any():
        return 0.0, 0.0
    way = float(np.average(np.maximum(line.gap, 0.0)[along].mean(axis=1), weights=weight))
    mine = _curvatures(line.position, line.direction, along)
    curvature = float(np.average(np.abs(mine), weights=weight))
    if way * curvature <= FAR or line.contact.primary is None:
        return way, way * curvature
    meets = line.partner >= 0
    facing, normal = np.zeros_like(line.position), np.zeros_like(line.position)
    at = line.partner[meets], line.partner_s[meets]
    facing[meets], normal[meets] = trace.point(*at), trace.exact_normal(*at)
    both = weight * meets[along].all(axis=1)
    theirs = np.sign(mine) * _curvatures(facing, normal, along)
    other = float(np.average(theirs, weights=both)) if both.any() else 0.0
    # 1 / (R + S); a hole of the same radius, drawn so beside a given gap, counts as one about it.
    together = curvature + other
    middle = -1 / way if together <= 0 else max(curvature * other / together, -1 / way)
    return way, way * curvature * (1 + way * middle / 2)


def drawn_gap(trace: BoundaryTrace, state: ContactState) -> Array:
    """Gaps (k,) of the drawing, lengths, at the points that meet the primary."""
    line = state.line
    meets = np.flatnonzero(line.partner >= 0)
    facing = trace.point(line.partner[meets], line.partner_s[meets])
    return np.einsum("ki,ki->k", line.direction[meets], facing - line.position[meets])


def apart(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where normals turn while bodies that are drawn apart come together, or nothing."""
    if state.line.contact.direction is not None:
        return ""
    way, error = way_and_error(trace, state)
    if error <= FAR:
        return ""
    return (
        f"bodies are drawn {way:.3g} apart, and the normals along which the gap is measured are "
        f"not followed on the way: the peak of the pressure is wrong by about {error:.2g} of it; "
        "draw the bodies touching, or give the common normal as direction"
    )


def contradicted(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where the given gap has the other sign than the one that is drawn, or nothing."""
    contact = state.line.contact
    if contact.gap is None or contact.primary is None:
        return ""
    sign = np.sign(state.line.gap[0])
    least = (sign * state.line.gap).min()
    if not least > 0:
        return ""
    other = (-sign * drawn_gap(trace, state)).min(initial=np.inf)
    if not OTHERWISE * least <= other < np.inf:
        return ""
    words = ("apart", "into each other")
    says, draws = words if sign > 0 else words[::-1]
    return (
        f"gap says that bodies are {least:.3g} {says} or more, the drawing has them {other:.3g} "
        f"{draws}: gap counts; it is positive where bodies are apart, and without it the drawing "
        "counts"
    )
