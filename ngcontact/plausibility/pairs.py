"""Plausibility of pairs in contact: directions, gaps, penetration, large strains.

Along a fixed direction xi the tangential part of the jump does not enter (2.10), and forces act
along xi. That is right to first order where one of the two surfaces lies across xi: points of the
other one, wherever they slide, meet the same line. Where both are inclined by an angle, as the two
sides of a groove are, forces that should act along the normals are wrong by its cosine.

Without a direction the gap is measured along the normals of the secondary as it is drawn (2.3).
On the way g over which a translation closes it, points slide by g theta where their normals are
turned by theta; there the gap has changed by its slope times that way. Between circles of radii R
and S (negative in a hole) the curvature of the gap, on which Hertz's formulas rest, comes out too
large by 2 g / R + g**2 / (R (R + S)), and the peak of the pressure by half of that: by g / R
between discs, by g / (2 R) for a pin that was drawn in the middle of its hole; too small by that
where the hole is the secondary.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index, across, rows_of
from ..contact import (
    ContactState,
    facing_pieces,
    interpolated_rays,
    opposite,
    prescribed_gap,
)
from ..fem import BoundaryTrace, FacetTrace
from ..reference import triangle
from ..solved import Solved

# Share of the force of a pair. Parts of a contact zone that carry less are not judged.
FORCE_SHARE = 0.01
# Nodes in contact that resolve a zone. Measured on 153 coarse meshes (discs, blocks with Hertz's
# gap, pins in holes, orders 1 to 4): of 55 zones with fewer 30 had a peak that was wrong by more
# than 10 %, 24 by more than 20 %; of 98 zones with more one was wrong by 12 %. Hertz's peaks were
# wrong by up to 70, 59, 64, 79 % at orders 1 to 4.
RESOLVED_NODES = 4
RESOLVED_HALF = 3  # ... that has one end on its line: one cut by a symmetry plane
# Round-off of contact forces, relative to the largest term of a nodal force.
FORCE_ROUND_OFF = 100 * np.finfo(float).eps
# Forces out of balance, relative to those of contact, from which round-off is reported.
LOST_SHARE = 1e-3
# Work of forces on the gaps that are left at their nodes, over twice the energy, from which these
# forces are wrong. Measured on 60 coarse meshes of solids: at most .08 where the energy is right to
# a third, .24 to 2.7 on facets as large as the radius of what presses, where it is 3 times off.
WORK_SHARE = 0.1
# Missing pressure relative to the peak pressure, from which a penetration is reported. Measured at
# orders 1 to 4: up to 0.12 beside a single point in contact, where results are right; 0.42 and more
# where curves touch between contact points, and forces are wrong by a third or vanish.
MISSING_PRESSURE = 0.25
# Mean pressure of a zone over the modulus of confined compression, from which strains are large: a
# layer would have no thickness left, a zone of Hertz be over two radii wide. Wrong signs and units
# exceed it by orders of magnitude. The mean is taken as the peak at the corners of a punch is
# infinite, and this modulus as nearly incompressible bodies bear pressures far above E.
LARGE_PRESSURE = 1.0
# Places on a part at which penetration is sampled: between two of them a curve departs from its
# chord by 1 / 16 of what it does on the part. Of triangles the corners and the centre.
PLACES = {2: (np.arange(4) + 0.5) / 4, 3: np.vstack([np.eye(3), triangle.CENTRE])}
MOST_SEGMENTS = 32  # segments of a pair that are sampled for penetration, those of least gap
LENGTH_ROUND_OFF = 100 * np.finfo(float).eps  # of lengths and displacements
# Angle to the direction, from which forces along it are wrong by 1 - cos = 3.4 %.
INCLINED_ANGLE = np.deg2rad(15)
# Predicted relative error of the peak pressure, from which bodies drawn apart are reported. The
# measured error over it: 0.93 to 1.05 between two discs (radii 1 and 1, 1 and 3, 3 and 1, drawn
# 0.01 to 0.16 apart); 0.93 to 0.96 of pins with a clearance of 2 to 25 % of their radius; of holes
# as secondary -1.02 to -1.06 (5 to 25 %), and half of that at 2 %.
PEAK_ERROR = 0.02
# Drawn gap over a given gap of the other sign, from which the two contradict each other.
CONTRADICTED_SHARE = 0.5


def pair_warnings(solution: Solved, *, last: bool) -> dict[tuple[str, int], str]:
    """Messages on implausible results, by the kind of warning and the number of the pair.

    On every mesh: fixed directions far from the normals, bodies that are drawn far apart, a given
    gap that contradicts the drawing, and strains that are not small. On the `last` mesh also:
    contact zones that the mesh does not resolve, penetration between contact points, bodies that
    move rigidly, and loads that bring no pair into contact. Solids that are drawn far apart are not
    checked.
    """
    pairs, program = solution.pairs, solution.discrete.program
    trace = solution.discrete.space.trace
    found: dict[tuple[str, int], str] = {}
    largest = [np.abs(state.force).max(initial=0.0) for state in pairs]
    noise = FORCE_ROUND_OFF * np.abs(program.diagonal * solution.minimiser.u).max(initial=0.0)
    if last and noise > LOST_SHARE * max(largest, default=noise) and (text := _lost(solution)):
        found["digits", 0] = text
    noise = max(noise, FORCE_ROUND_OFF * max(largest, default=0.0))
    peak = max((state.pressure.max(initial=0.0) for state in pairs), default=0.0)
    for number, (state, force) in enumerate(zip(pairs, largest, strict=True)):
        zones = zones_of(state) if force > noise else None
        messages = {"strain": _large_strains(solution, state, zones) if zones else ""}
        if zones and not messages["strain"]:  # else no other check means anything
            messages["direction"] = _inclined(trace, state) or _drawn_apart(trace, state)
            messages["gap"] = contradicted(trace, state)
            if last:
                messages["zone"] = _held_apart(solution, state) or _small_zone(trace, state, zones)
        if last and not messages["strain"]:  # with forces or without
            messages["penetration"] = _penetration(solution, state, peak)
        name = f"contact {number} of {state.line.contact.named()}"
        found |= {(what, number): f"{name}: {text}" for what, text in messages.items() if text}
    if last and max(largest, default=0.0) <= noise and (text := _unresisted(solution)):
        found["rigid", 0] = text
    if last and not found and (text := _all_open(solution)):
        found["open", 0] = text
    return found


def _lost(solution: Solved) -> str:
    """Message where round-off of a stiff body's forces is large, or made contact pull; else ""."""
    p, u, force = solution.discrete.program, solution.minimiser.u, solution.force
    residual = (p.b - p.K @ u - p.pull(force))[~p.fixed]
    pulling = -force[~p.equality].min(initial=0.0)
    # Where contact is idle the work of others' forces tells how large they are.
    size = max(np.abs(force).sum(), solution.energy_norm**2 / np.abs(u).max())
    lost = max(np.linalg.norm(residual), pulling) / size
    if solution.stress_free or lost <= LOST_SHARE:
        return ""
    return (
        f"round-off takes digits of forces: those on a stiff body, reactions included, are out of "
        f"balance by about {lost:.1g} of those of contact. Displace the softer body, give its side "
        "as secondary, or make the stiff one an obstacle (primary=None) or its moduli less"
    )


def _all_open(solution: Solved) -> str:
    """Message where bodies move and no pair comes into contact or closer; "" elsewhere."""
    pairs = [state for state in solution.pairs if state.gap.size]
    nearer = [state.active.any() or state.gap.min() < state.line.gap.min() for state in pairs]
    if not pairs or any(nearer) or not solution.displacement.vec.FV().NumPy().any():
        return ""
    return (
        "no pair is in contact, and none comes nearer; look at the signs of displacement, strain "
        "and gap"
    )


def _unresisted(solution: Solved) -> str:
    """Message where bodies in contact move rigidly; "" elsewhere."""
    touching = any(state.active.any() for state in solution.pairs)
    moved = solution.displacement.vec.FV().NumPy().any()
    if not (touching and moved and solution.stress_free):
        return ""
    return (
        "nothing deforms: bodies in contact move rigidly, as nothing resists them, and all contact "
        "forces are round-off; relative errors mean nothing here. Hold the body that is pushed by "
        "a support or a load if it should resist"
    )


@dataclass(frozen=True, eq=False)
class ContactZones:
    """The k connected zones of one pair in which its bodies touch."""

    force: Array  # (k,), sums over the points of each zone, as a pair's force
    weight: Array  # (k,), a length, of solids an area
    nodes: Index  # (k,), numbers of nodes in contact
    ends: Index  # (k,), intervals or facets with points in contact and open ones


def _labels(linked: Index, count: int) -> Index:
    """One number (count,) for each connected part of points, of which (l, 2) are `linked`."""
    label = np.arange(count)
    while (label[linked[:, 0]] != label[linked[:, 1]]).any():  # of paths: as often as they halve
        np.minimum.at(label, linked, label[linked].min(axis=1, keepdims=True))
        label = label[label]
    return label


def zones_of(state: ContactState) -> ContactZones:
    """The zones of one pair: points in contact are linked along the line, of solids by facets."""
    line, m, corners = state.line, len(state.gap), state.line.twins
    closed, parts = state.active, line.rows
    if line.dim == 2:
        closed, parts = state.in_contact, line.links
    met, opened = ((parts >= 0) & x[parts] for x in (closed, ~closed))
    first = parts[np.arange(len(parts)), met.argmax(axis=1)]
    label = _labels(np.array([(first[:, None] + 0 * parts)[met], parts[met]]).T, m)

    def sums(points: Index, values: Array | None = None) -> NDArray[Any]:
        """Sums (k,) by zones of `values` (j,), of ones without any, at `points` (j,)."""
        return np.bincount(label[points], values, m)[zones]

    (inside,) = closed.nonzero()
    (zones,) = np.bincount(label[inside], minlength=m).nonzero()
    return ContactZones(
        force=sums(inside, state.force[inside]),
        weight=sums(inside, line.weight[inside]),
        nodes=sums(inside) - sums(corners[closed[corners].all(axis=1), 0]),
        ends=sums(first[met.any(axis=1) & opened.any(axis=1)]),
    )


def _large_strains(solution: Solved, state: ContactState, zones: ContactZones) -> str:
    """Message where strains are not small; "" elsewhere."""
    pressure = float((np.abs(zones.force) / zones.weight).max(initial=0.0))
    moduli, trace = solution.moduli, solution.discrete.space.trace
    modulus = _softer(moduli.bulk + moduli.shear, trace, state)
    if pressure <= LARGE_PRESSURE * modulus:
        return ""
    return (
        f"the mean pressure in contact, {pressure:.3g}, is {pressure / modulus:.2g} times the "
        f"modulus {modulus:.3g} of the softer body in confined compression: strains are not small; "
        "check the sign of gap (positive where bodies are apart) and the units of E, loads, lengths"
    )


def _softer(modulus: Array, trace: BoundaryTrace, state: ContactState) -> float:
    """Mean of a `modulus` (ne,) over the elements at each side; that of the softer, a stress."""
    sides = [trace.element[state.line.segments], trace.element[state.line.facing]]
    return float(min(modulus[side].mean() for side in sides if len(side)))


def _small_zone(trace: BoundaryTrace, state: ContactState, zones: ContactZones) -> str:
    """Message where the mesh does not resolve a contact zone; "" elsewhere.

    A whole line in contact has no ends to be resolved. Of solids many nodes may be one row of them,
    as below a roller: some triangle of neighbours has to be in contact, too.
    """
    cut = (zones.ends > 0) & (np.abs(zones.force) > FORCE_SHARE * np.abs(state.force).sum())
    half = (zones.ends == 1) & (state.line.dim == 2)
    needed = np.where(half, RESOLVED_HALF, RESOLVED_NODES)
    small, text = np.flatnonzero(cut & (zones.nodes < needed)), "of at least {} nodes"
    if isinstance(trace, FacetTrace) and not small.size:
        closed = state.line.on_segments(state.active, False)[:, triangle.parts(trace.order)]
        small, text = np.flatnonzero(cut & ~closed.all(axis=2).any()), "nodes in one row"
    if state.line.contact.bilateral or not small.size:
        return ""
    worst = small[np.argmin(zones.nodes[small] / needed[small])]
    return (
        f"a zone in contact is not resolved, by {zones.nodes[worst]} "
        f"{text.format(needed[worst])}: the peak of its pressure may be wrong by half, of solids "
        "its force, too; use adapt, or a smaller maxh"
    )


@dataclass(frozen=True, eq=False)
class _Samples:
    """k samples of two facing surfaces between contact points."""

    segment: Index  # (k,), of the secondary
    s: Array  # (k, ...), places on it
    x: Array  # (k, d), lengths
    direction: Array  # (k, d), unit vectors to the primary
    facing: Index  # (k,), segments of the primary, negative where none faces
    s_facing: Array  # (k, ...), places on these
    distance: Array  # (k,), drawn, along the direction; infinite where nothing faces


def _samples(trace: BoundaryTrace, state: ContactState) -> _Samples:
    """Samples of facing parts where a point is open; on lines of small gaps that change much."""
    line, contact, gap = state.line, state.line.contact, np.maximum(state.gap, 0.0)
    some = np.asarray(line.on_segments(~state.active, False).any(axis=1))
    if line.dim == 2:
        whole = np.flatnonzero(some & (line.rows >= 0).all(axis=1))
        rows, high = line.rows[whole], gap.copy()
        np.maximum.at(high, rows, gap[rows].max(axis=1, keepdims=True))
        least, most = gap[rows].min(axis=1), high[rows].max(axis=1)
        near = np.flatnonzero(2 * least < most)
        some = np.zeros(len(line.rows), dtype=bool)
        some[whole[near[np.argsort(least[near], kind="stable")[:MOST_SEGMENTS]]]] = True
    parts, _ = facing_pieces(trace, line, some)
    places = PLACES[line.dim]
    each, s = rows_of(parts, np.arange(len(parts.local)).repeat(len(places))), parts.places(places)
    segment = line.segments[each.local]
    x, d = trace.point(segment, s), interpolated_rays(trace, contact, line.segments, each.local, s)
    there, distance = each.opposite, np.zeros(len(x))
    if contact.primary is not None:
        there, distance = opposite(trace, x, d, each.facing, there)
    return _Samples(segment, s, x, d, each.facing, there, distance)


def _left(solution: Solved, state: ContactState, seen: _Samples) -> tuple[_Samples, Array, float]:
    """The samples that face something, gaps (k,) left there by (2.10), and their round-off."""
    trace, contact = solution.discrete.space.trace, state.line.contact
    if contact.gap is not None and len(seen.x):
        apart = prescribed_gap(contact, trace, seen.segment, seen.s, seen.x)
        seen = replace(seen, distance=apart)
    met = np.isfinite(seen.distance) & ((seen.facing >= 0) | (contact.primary is None))
    if not met.any():
        return rows_of(seen, met), np.zeros(0), 0.0
    seen = rows_of(seen, met)
    u = trace.evaluate(solution.displacement, seen.segment, seen.s)
    noise = LENGTH_ROUND_OFF * (np.abs(u).max() + np.abs(seen.x).max())
    if contact.primary is not None:
        u = u - trace.evaluate(solution.displacement, seen.facing, seen.s_facing)
    left = seen.distance - (u * seen.direction).sum(axis=1)  # (2.10)
    return seen, left, float(noise)


def _held_apart(solution: Solved, state: ContactState) -> str:
    """Message where rows that are means have forces at nodes that stay apart; "" elsewhere."""
    line, trace = state.line, solution.discrete.space.trace
    means = state.active & line.means & (line.partner >= 0)
    # Others stand for held nodes beside, too.
    means[line.rows[line.rows != line.rows_at(trace.nodes[line.segments])]] = False
    if not means.any():
        return ""
    point, place = np.unique(line.rows, return_index=True)
    point, place = point[(point >= 0) & means[point]], place[(point >= 0) & means[point]]
    segment, s = trace.at_nodes(line.segments)
    x, d, there = line.position[point], line.direction[point], line.partner[point]
    facing = trace.point(there, line.partner_s[point])
    seen = _Samples(
        segment[place], s[place], x, d, there, line.partner_s[point], ((facing - x) * d).sum(axis=1)
    )
    _, left, _ = _left(solution, state, seen)
    work = state.force[point] * np.maximum(left, 0.0)
    if work.sum() <= WORK_SHARE * solution.energy_norm**2:
        return ""
    worst = int(np.argmax(work))
    return (
        f"bodies press on each other where they are apart, by {left[worst]:.3g} at "
        f"({', '.join(f'{value:.4g}' for value in x[worst])}): a row is a mean over facets that "
        "are larger than the zone in contact, and forces or energy may be wrong by a factor; use "
        "adapt, or a smaller maxh on the secondary, or exchange the sides of the pair"
    )


def _penetration(solution: Solved, state: ContactState, peak: float) -> str:
    """Message where bodies penetrate each other, by pressures over a `peak`; "" elsewhere."""
    trace = solution.discrete.space.trace
    if state.line.contact.bilateral or state.active.all():
        return ""
    seen, left, noise = _left(solution, state, _samples(trace, state))
    if not left.size:
        return ""
    deepest = int(np.argmin(left))
    depth = -float(left[deepest])
    if depth <= noise:
        return ""
    [length] = trace.lengths(seen.segment[[deepest]])
    missing = _softer(solution.moduli.shear, trace, state) * depth / float(length)
    if missing <= MISSING_PRESSURE * peak:
        return ""
    place = ", ".join(f"{value:.4g}" for value in seen.x[deepest])
    return (
        f"bodies pass through each other between contact points, by {depth:.3g} near "
        f"({place}), where no point lies: pressures of about {missing:.2g} are not seen; "
        "give the mesh a node there, or use adapt, or a smaller maxh"
    )


def _inclined(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where surfaces that carry force are inclined to the direction; "" elsewhere."""
    xi = state.line.contact.direction
    if xi is None or not state.active.any():
        return ""
    angle, force = inclinations(trace, state, np.array(xi)), np.abs(state.force)
    if force[angle > INCLINED_ANGLE].sum() <= FORCE_SHARE * force.sum():
        return ""
    return (
        f"surfaces in contact are inclined to direction=({', '.join(f'{x:.3g}' for x in xi)}) by "
        f"up to {np.rad2deg(angle.max()):.0f} degrees, so that forces do not act along their "
        "normals; leave the direction out (direction=None), or give each flank a pair of its own "
        "direction"
    )


def inclinations(trace: BoundaryTrace, state: ContactState, xi: Array) -> Array:
    """Least angles (m,), radians, between `xi` (d,) and both surfaces; 0 at open points."""
    line, cosine = state.line, np.full(len(state.active) + 1, -1.0)
    rows, segments = line.rows[state.touched], line.segments[state.touched]
    np.maximum.at(cosine, rows.ravel(), trace.exact_normal(*trace.at_nodes(segments)) @ xi)
    if line.contact.primary is None and len(xi) == 2:  # a line: the secondary moved by the gap
        whole = rows[(rows >= 0).all(axis=1)]
        moved = (line.position + line.gap[:, None] * xi)[whole]
        chord = moved[:, -1] - moved[:, 0]
        slope = np.abs(across(chord) @ xi) / np.linalg.norm(chord, axis=1)
        np.maximum.at(cosine, whole, slope[:, None])
    cosine, met = cosine[:-1], np.flatnonzero(state.active & (line.partner >= 0))
    there = -trace.exact_normal(line.partner[met], line.partner_s[met]) @ xi
    cosine[met] = np.maximum(cosine[met], there)
    return np.where(state.active, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)


def _drawn_apart(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where normals turn over the gap that is drawn; "" elsewhere, and of solids."""
    if state.line.contact.direction is not None or state.line.dim == 3:
        return ""
    gap, error = drawn_gap_error(trace, state)
    if error <= PEAK_ERROR:
        return ""
    return (
        f"bodies are drawn {gap:.3g} apart, and the normals along which the gap is measured are "
        f"not followed on the way: the peak of the pressure is wrong by about {error:.2g} of it; "
        "draw the bodies touching, or give the common normal as direction"
    )


def drawn_gap_error(trace: BoundaryTrace, state: ContactState) -> tuple[float, float]:
    """Drawn gap where forces act, a length, and the relative error of the peak pressure it causes.

    Means weighted by force; 0 where normals do not turn or the bodies are drawn touching. Errors up
    to `PEAK_ERROR` are upper bounds.
    """
    line, force, along = state.line, np.abs(state.force), state.line.links
    along = along[np.diff(line.node[along], axis=1)[:, 0] != 0]
    weight = force[along].sum(axis=1)
    if not weight.any():
        return 0.0, 0.0

    def curvatures(points: Array, normals: Array) -> Array:  # between neighbours, 1 / length
        chord, turn = (np.diff(values[along], axis=1)[:, 0] for values in (points, normals))
        length = (chord * chord).sum(axis=1)
        bend = (turn * chord).sum(axis=1)
        return np.divide(bend, length, out=np.zeros(len(along)), where=length > 0)

    gap = float(np.average(np.maximum(line.gap, 0.0)[along].mean(axis=1), weights=weight))
    mine = curvatures(line.position, line.direction)
    curvature = float(np.average(np.abs(mine), weights=weight))
    if gap * curvature <= PEAK_ERROR or line.contact.primary is None:
        return gap, gap * curvature
    meets = line.partner >= 0
    facing, normal = np.zeros_like(line.position), np.zeros_like(line.position)
    at = line.partner[meets], line.partner_s[meets]
    facing[meets], normal[meets] = trace.point(*at), trace.exact_normal(*at)
    both = weight * meets[along].all(axis=1)
    theirs = np.sign(mine) * curvatures(facing, normal)
    other = float(np.average(theirs, weights=both)) if both.any() else 0.0
    # 1 / (R + S); a hole of the same radius, drawn so beside a given gap, counts as one about it.
    together = curvature + other
    middle = -1 / gap if together <= 0 else max(curvature * other / together, -1 / gap)
    return gap, gap * curvature * (1 + gap * middle / 2)


def contradicted(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where a given gap and the drawn one have opposite signs; "" elsewhere."""
    line, contact = state.line, state.line.contact
    if contact.gap is None or contact.primary is None:
        return ""
    sign = np.sign(line.gap[0])
    least = (sign * line.gap).min()
    if not least > 0:
        return ""
    meets = np.flatnonzero(line.partner >= 0)
    facing = trace.point(line.partner[meets], line.partner_s[meets])
    drawn = ((facing - line.position[meets]) * line.direction[meets]).sum(axis=1)
    other = (-sign * drawn).min(initial=np.inf)
    if not CONTRADICTED_SHARE * least <= other < np.inf:
        return ""
    words = ("apart", "into each other")
    says, draws = words if sign > 0 else words[::-1]
    return (
        f"gap says that bodies are {least:.3g} {says} or more, the drawing has them {other:.3g} "
        f"{draws}: gap counts; it is positive where bodies are apart, and without it the drawing "
        "counts"
    )
