"""State of each pair: gap, force, pressure, and ends of contact."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq

from ..arrays import Array, Index, Mask, distances_along
from ..fem import ORDERS, Model
from .line import ContactLine

# Stencil of the fit, by measurement on Hertz contact at orders 1 to 4: the two points next to the
# contact carry the error of the element in which it ends.
SKIPPED_POINTS = 2
FIT_POINTS = 8  # points of the fit, or three per order and two if that is more
FIT_DEGREE = 3  # of the fit, 2 at order 1
FIT_SAMPLES = 65  # places at which the fit is evaluated to bracket its zero


def _run_of_points(
    start: int, before: int, beside: dict[int, list[int]], active: Mask
) -> list[int]:
    """Points from `start` on, away from `before`, as long as they share the state of `start`."""
    run, last = [start], before
    while True:
        onward = [i for i in beside[run[-1]] if i != last]
        if not onward or active[onward[0]] != active[start] or onward[0] in run:
            return run
        last = run[-1]
        run.append(onward[0])


def _closing_point(distance: Array, gap: Array, order: int) -> float:
    """Where gap^(2/3), fitted to open points at `distance` (k,) from contact, is 0.

    Without enough points, or a zero before the last of them, the middle before the first.
    """
    chosen = slice(SKIPPED_POINTS, SKIPPED_POINTS + max(FIT_POINTS, 3 * order + 2))
    x, y = distance[chosen], np.maximum(gap[chosen], 0.0) ** (2 / 3)
    if len(x) < 2 or y[-1] <= 0:
        return float(distance[0]) / 2
    fit = np.polynomial.Polynomial.fit(x, y, min(FIT_DEGREE, order + 1, len(x) - 1))
    # The last active point may lie on the open side by the error of one element. The zero is
    # bracketed: the roots of a companion matrix are lost where leading coefficients are round-off.
    places, step = np.linspace(-distance[0], x[0], FIT_SAMPLES, retstep=True)
    below = np.flatnonzero(fit(places) <= 0)
    if len(below) == 0 or below[-1] == FIT_SAMPLES - 1:
        return float(distance[0]) / 2
    low = places[below[-1]]
    return float(low + step * brentq(lambda t: fit(low + step * t), 0, 1, xtol=1e-15))


@dataclass(frozen=True, eq=False)
class Transitions:
    """Places where contact of one pair turns from binding to non-binding, k of them."""

    inner: Index  # (k,) the last active contact point
    outer: Index  # (k,) the first open one; at a corner the one after that
    position: Array  # (k, 2) the transition itself
    beyond: Array  # (k,) its distance from the last active point along the line, outwards
    # For each end the points from there on, as far as contact is closed or open:
    closed: list[Index]  # the points (q,) from the last active one inwards
    opened: list[Index]  # and those (q,) from the first open one outwards


# Of the radius of a zone around an axis, over which its pressure is fitted there.
AXIS_SHARE = 1 / 3
LONG_SEGMENT = 0.2  # over half a zone, from which its end is told better by force than by gap


@dataclass(frozen=True, eq=False)
class ContactState:
    """One pair after deformation, at the m points of its line. Any consistent units.

    Attributes
    ----------
    line : ContactLine
        The pair and its points.
    gap : ndarray (m,)
        Along the direction of each point, a length; >= 0 up to round-off.
    force : ndarray (m,)
        lambda_j, not negative unless the pair is bilateral; a force per unit thickness.
    active : ndarray of bool (m,)
        Points in contact.
    """

    line: ContactLine
    gap: Array
    force: Array
    active: Mask
    ends: Transitions | None = None  # where they are not those of the gap

    @property
    def pressure(self) -> Array:
        """-T_n per unit length (P1), -T_xi per unit eta (P2), (m,): units of stress."""
        pressure = self.line.pressure(self.force)  # (3.10), (3.10')
        return continued_to_axis(self.line, pressure, self.active)

    @property
    def touched(self) -> Mask:
        """Segments (k,) with a point in contact."""
        return np.asarray(self.line.on_segments(self.active, False).any(axis=1))

    @cached_property
    def in_contact(self) -> Mask:
        """Points (m,) that are active, and open ones at corners inside the contact.

        The node touches the other side of the corner, and the next point on this side is active:
        one of the two rows is released where the node would rather slide off the corner.
        """
        state, active, corners = self.active.copy(), self.active, self.line.twins
        for i in corners[active[corners].sum(axis=1) == 1].ravel():
            if not active[i]:
                first, last = self.line.rows[:, :-1], self.line.rows[:, 1:]
                next_to = np.concatenate([last[first == i], first[last == i]])
                state[i] = (next_to >= 0).all() and active[next_to].all()
        return state

    @cached_property
    def transitions(self) -> Transitions:
        """Transitions from binding to non-binding contact, between neighbours.

        Near a frictionless transition the gap grows like the 3/2 power of the distance, so that
        gap^(2/3) is a smooth function of it with a simple zero at the transition. That zero is
        found from a cubic fitted to the open points near by, the nearest ones left out. Without
        enough of them - contact that opens at a few points only - it is the middle between the two
        points. Between the two points at a corner it is the corner.
        """
        if self.ends is not None:
            return self.ends
        line, active, linked = self.line, self.in_contact, self.line.links
        beside: dict[int, list[int]] = defaultdict(list)
        for a, b in linked.tolist():
            beside[a].append(b)
            beside[b].append(a)
        x, order, found = line.position, line.rows.shape[1] - 1, list[tuple[Any, ...]]()
        for link in linked[active[linked[:, 0]] != active[linked[:, 1]]].tolist():
            inner, outer = sorted(link, key=lambda i: not active[i])
            outwards = _run_of_points(outer, inner, beside, active)
            inwards = _run_of_points(inner, outer, beside, active)
            runs = np.array(inwards), np.array(outwards)
            if line.node[inner] == line.node[outer]:  # the node touches one side of a corner only
                found.append((inner, outwards[min(1, len(outwards) - 1)], x[inner], 0.0, *runs))
                continue
            if len(outwards) > 1 and any(active[i] for i in beside[outwards[-1]]):
                outwards = outwards[: (len(outwards) + 1) // 2]  # its other end uses the other half
            way = 0.0  # of `polish`: a vertex of the mesh lies there
            if order <= ORDERS[-1]:
                distance = distances_along(x[[inner, *outwards]])[1:]
                way = _closing_point(distance, self.gap[outwards], order)
            path = np.array([*inwards[1::-1], *outwards])
            along = distances_along(x[path])
            at = way + along[min(len(inwards), 2) - 1]
            place = [np.interp(at, along, x[path, axis]) for axis in (0, 1)]
            found.append((inner, outer, place, way, *runs))
        columns = list(zip(*found, strict=True)) or [()] * 6
        points, position = np.array(columns[:2], dtype=np.intp), np.reshape(columns[2], (-1, 2))
        beyond, closed, opened = np.array(columns[3], dtype=float), *map(list, columns[4:])
        return Transitions(points[0], points[1], position, beyond, closed, opened)

    @property
    def ending_segments(self) -> Index:
        """Segments (j,) in which contact ends; at corners, those beside."""
        rows, ends = self.line.rows[:, :, None], self.transitions
        inner, outer = ((rows == points).any(axis=1) for points in (ends.inner, ends.outer))
        at = np.where((inner & outer).any(axis=0), inner & outer, inner | outer)
        return self.line.segments[at.any(axis=1)]

    def expected(self, modulus: float, model: Model) -> ContactState:
        """The state that a finer mesh should find: contact ends where its forces tell.

        These are right long before points resolve a zone. Under a force F per length, with a gap of
        curvature k between bodies of the `modulus` E*, it has Hertz's half-width a, the root of
        4 F / (pi E* k), around an axis the cube root of 3 F / (4 E* k). That is taken where it ends
        in the same segment as by the gap, and the segment is long. A zone with one end on its line
        is half of one.
        """
        ends, active, x = self.transitions, self.active.copy(), self.line.position
        inner, outer, position = ends.inner.copy(), ends.outer.copy(), ends.position.copy()
        order = self.line.rows.shape[1] - 1
        for k, (closed, opened) in enumerate(zip(ends.closed, ends.opened, strict=True)):
            path, first = np.append(closed[::-1], opened[: max(order, 2)]), len(closed)
            force = self.force[closed].sum()
            if len(path) < 3 or force <= 0 or ends.beyond[k] == 0:  # at a corner, or a vertex
                continue
            middle, part = self.force[closed] @ x[closed] / force, 1
            if np.isin(ends.inner, closed).sum() == 1:
                middle, part = x[closed[-1]], 2
            s = (x[path] - middle) @ (x[path[-1]] - middle)
            s /= np.sqrt(s[-1])
            powers = np.vander(s / s[-1], 3)
            curvature = 2 * np.linalg.lstsq(powers, self.line.gap[path])[0][0] / s[-1] ** 2
            if curvature <= 0:
                continue
            if self.line.on_axis[closed].any():
                a = np.cbrt(0.75 * force / (modulus * curvature))
            else:
                per_length = part * force / model.measure(middle[None])[0]
                a = np.sqrt(4 * per_length / (np.pi * modulus * curvature))
            long = s[-1] - s[first - 1] > LONG_SEGMENT * a
            if long and s[max(first - 1 - order, 0)] <= a < s[-1]:
                active[path[s > 0]] = s[s > 0] <= a
                active[path[np.abs(s).argmin()]] = True
                last = max(int(np.count_nonzero(s <= a)), 1)
                inner[k], outer[k] = path[last - 1 : last + 1]
                position[k] = [np.interp(a, s, x[path, axis]) for axis in (0, 1)]
        ends = replace(ends, inner=inner, outer=outer, position=position)
        return replace(self, active=active, ends=ends)


def continued_to_axis(line: ContactLine, pressure: Array, active: Mask) -> Array:
    """Values (m,) of the `pressure` (m,), on an axis of revolution the even one of those beside.

    At orders 1 and 2 the point on the axis, of the least weight, has an error of the size of the
    element's: on balls at 5000 unknowns 6.5 and 1.3 %, of the continuation 0.3 %. It is the
    fit of c0 + c1 r^2, by weights, to the nearer third of the contact around the axis, `active`
    (m,), with an error of 3e-4 on balls; with fewer than two points there the value is as it is.
    """
    if line.rows.shape[1] > 3 or not line.on_axis.any():
        return pressure
    pressure = pressure.copy()
    for i in np.flatnonzero(line.on_axis & active):
        square = ((line.position - line.position[i]) ** 2).sum(axis=1)
        near = np.argsort(square, kind="stable")
        closed = np.append(np.flatnonzero(~active[near]), len(near))[0]
        near = near[:closed][square[near[:closed]] <= AXIS_SHARE**2 * square[near[closed - 1]]]
        if len(near) > 2:
            root = np.sqrt(line.weight[near])
            powers = np.column_stack([np.ones(len(near)), square[near] / square[near[-1]]])
            fit = np.linalg.lstsq(root[:, None] * powers, root * pressure[near], rcond=None)[0]
            pressure[i] = fit[0]
    return pressure


def state_of(states: Sequence[ContactState], pair: int) -> ContactState:
    """The state of one `pair`, by its number; what numbers none of them is refused."""
    count = len(states)
    right = f"the pairs are numbered from 0 to {count - 1}" if count else "there is no contact"
    if isinstance(pair, bool) or not isinstance(pair, int | np.integer):
        raise TypeError(f"pair={pair!r} is not an integer; {right}")
    if not 0 <= pair < count:
        raise ValueError(f"pair={pair} is not a contact pair; {right}")
    return states[pair]
