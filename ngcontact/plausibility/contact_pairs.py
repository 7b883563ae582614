"""What may be wrong with a solution: directions, gaps, penetration, large strains.

Along a fixed direction xi the tangential part of the jump does not enter (2.10), and forces act
along xi. That is right to first order where one of the two surfaces lies across xi: points of the
other one, wherever they slide, meet the same line. Where both are inclined by an angle, as the two
sides of a groove are, forces that should act along the normals are wrong by its cosine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..contact import ContactState, partners, prescribed_gap
from ..fem import BoundaryTrace, Space, bulk_moduli, shear_moduli, stiffer_than
from ..lagrange import gauss_lobatto, lagrange_derivative
from ..problem import Problem
from .drawn import Zones, apart, contradicted, zones_of
from .estimates import moves_rigidly

# Share of a pair's force below which a part of its zone does not matter.
SHARE = 0.01
# Intervals between nodes, for each end at open points, from which a zone in contact is resolved:
# half a zone has one end, as its pressure has the peak in the middle. On 153 coarse meshes (discs,
# blocks with Hertz's gap, pins in holes, orders 1 to 4) the peak was wrong by more than 10 % in 30
# of 55 zones below, in 1 of 98 above (12 %), by more than 20 % in 24 and none. Three segments at
# all orders told 93, of which 30 were wrong by 10 %.
RESOLVED = 2
# Contact forces of this size, relative to the largest term of a force, are round-off.
NOISE = 100 * np.finfo(float).eps
# Share of the peak of the pressure from which it matters that bodies pass through each other. They
# do by up to 0.12 beside a single point in contact, measured at orders 1 to 4; where curves touch
# between points by 0.42 and more, with forces wrong by a third or not there.
MISSING = 0.25
# Mean pressure of a zone over the modulus of confined compression from which a result means
# nothing: a layer would be pressed to no thickness, Hertz's zone be over two radii wide. Wrong
# signs and units lie beyond by orders of magnitude, examples with loads in units of E do not. The
# mean of a zone stays finite at the corners of a punch, where the peak does not; confined bodies
# that are nearly incompressible bear pressures far above E at small strains.
LARGE = 1.0
PLACES = (np.arange(4) + 0.5) / 4  # on a segment; what lies between them is 1 / 16 of its sagitta
MOST = 32  # segments of a pair that are looked at
ROUND_OFF = 100 * np.finfo(float).eps  # of lengths and displacements
INCLINED = np.deg2rad(15)  # from which forces along the direction are wrong by 1 - cos = 3.4 %
TURN = np.cos(INCLINED / 2)  # mean of two unit normals at a vertex below which it is a corner


def _at_vertices(
    point: Index, at_end: Mask, normal: Array, xi: Array, count: int
) -> tuple[Array, Mask]:
    """Cosine (count,) of the normal nearest to `xi` at each point, and where the curve is smooth.

    `point` (k,) numbers those of the unit normals `normal` (k, 2), `at_end` (k,) tells which are
    one-sided at an end of a segment: at ends of the line and at corners no mean is a unit vector.
    """
    cosine, mean = np.full(count, -1.0), np.zeros((count, 2))
    np.maximum.at(cosine, point, normal @ xi)
    np.add.at(mean, point, np.where(at_end, 0.5, 1.0)[:, None] * normal)
    return cosine, np.linalg.norm(mean, axis=1) > TURN


def _of_secondary(trace: BoundaryTrace, state: ContactState, xi: Array) -> tuple[Array, Mask]:
    """Cosine (m,) of the secondary's normal at the points in contact, and where it is smooth."""
    line, m = state.line, len(state.active)
    touching = np.flatnonzero(np.append(state.active, False)[line.rows].any(axis=1))
    point = line.rows[touching].ravel()
    segment, s = trace.at_nodes(line.segments[touching])
    normal = trace.exact_normal(segment, s)
    has = point >= 0
    return _at_vertices(point[has], np.isin(s[has], (0.0, 1.0)), normal[has], xi, m)


def _of_primary(
    trace: BoundaryTrace, state: ContactState, points: Index, xi: Array
) -> tuple[Array, Mask]:
    """The same of the primary, where it is met from the `points` (k,) of the secondary."""
    line = state.line
    segment, s = line.partner[points], line.partner_s[points]
    point, end = np.arange(len(points)), np.isin(s, (0.0, 1.0))
    vertex = trace.nodes[segment, np.where(s < 0.5, 0, -1)]
    # Both segments at a vertex: all that end there.
    ends = trace.nodes[line.facing][:, [0, -1]]
    which, local, side = np.nonzero(vertex[end, None, None] == ends)
    point = np.concatenate([point[~end], point[end][which]])
    at_end = np.concatenate([np.zeros(np.count_nonzero(~end), bool), np.ones(len(which), bool)])
    segment = np.concatenate([segment[~end], line.facing[local]])
    s = np.concatenate([s[~end], side.astype(float)])
    return _at_vertices(point, at_end, -trace.exact_normal(segment, s), xi, len(points))


def _of_obstacle(state: ContactState, points: Index, xi: Array) -> tuple[Array, Mask]:
    """The same of a rigid obstacle, whose curve is that of the secondary moved by the gap."""
    line = state.line
    order = line.rows.shape[1] - 1
    whole = line.rows[(line.rows >= 0).all(axis=1)]
    curve = (line.position + line.gap[:, None] * xi)[whole]
    slope = np.einsum("ni,kid->knd", lagrange_derivative(order, gauss_lobatto(order)), curve)
    tangent = slope / np.linalg.norm(slope, axis=2)[:, :, None]
    cosine = np.full(len(line.node), -1.0)
    np.maximum.at(cosine, whole, np.abs(tangent[:, :, 0] * xi[1] - tangent[:, :, 1] * xi[0]))
    return cosine[points], np.ones(len(points), dtype=bool)


def lies_across(trace: BoundaryTrace, state: ContactState) -> bool:
    """Whether the secondary has straight edges alone in contact, none inclined to the direction."""
    line = state.line
    if line.contact.direction is None or trace.edges is None:
        return False
    touching = np.append(state.active, False)[line.rows].any(axis=1)
    segments = line.segments[touching]
    chord = trace.curve[segments, -1] - trace.curve[segments, 0]
    along = np.abs(chord @ np.array(line.contact.direction))
    straight = all(trace.edges[k].straight for k in set(trace.region[segments].tolist()))
    return straight and bool((along <= np.sin(INCLINED) * trace.lengths(segments)).all())


def inclinations(trace: BoundaryTrace, state: ContactState) -> Array:
    """Angles (m,) in radians between a pair's fixed direction and the surfaces; 0 where open.

    The smaller one of both surfaces; ends of their lines and corners have no normal of their own
    and count only where neither surface has.
    """
    line = state.line
    if line.contact.direction is None or not state.active.any():
        return np.zeros(len(state.active))
    xi = np.array(line.contact.direction)
    cosine, smooth = _of_secondary(trace, state, xi)
    cosine[~state.active] = 1.0
    steep = np.flatnonzero(cosine < np.cos(INCLINED))
    if len(steep):
        rigid = line.contact.primary is None
        other, plain = (
            _of_obstacle(state, steep, xi) if rigid else _of_primary(trace, state, steep, xi)
        )
        mine = np.where(smooth[steep] | ~plain, cosine[steep], -1.0)
        cosine[steep] = np.maximum(mine, np.where(plain | ~smooth[steep], other, -1.0))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


@dataclass(frozen=True, eq=False)
class Penetration:
    """Where bodies of one pair pass through each other most.

    Attributes
    ----------
    depth : float
        How deep, a length; 0 where they do not.
    slope : float
        Depth over the length of the segment: times a modulus a pressure that is not there.
    place : ndarray (2,)
        Where, on the secondary.
    """

    depth: float
    slope: float
    place: Array


def _suspected(state: ContactState) -> Index:
    """Numbers (j,) in `line.segments` between whose nodes the gap may be negative.

    Not where all nodes are in contact, and not where the gap is wide beside its change on the
    segment and its neighbours.
    """
    line, gap = state.line, np.maximum(state.gap, 0.0)
    if state.active.all():
        return line.segments[:0]
    whole = np.flatnonzero((line.rows >= 0).all(axis=1))
    rows = line.rows[whole]
    high = np.zeros(len(gap))
    np.maximum.at(high, rows, np.broadcast_to(gap[rows].max(axis=1)[:, None], rows.shape))
    least, most = gap[rows].min(axis=1), high[rows].max(axis=1)
    near = np.flatnonzero((2 * least < most) & ~state.active[rows].all(axis=1))
    return whole[near[np.argsort(least[near], kind="stable")[:MOST]]]


def penetration(
    trace: BoundaryTrace, displacement: ng.GridFunction, state: ContactState
) -> Penetration:
    """Largest penetration between the contact points of one pair, on the curves of the mesh."""
    line, local = state.line, _suspected(state)
    none = Penetration(0.0, 0.0, np.full(2, np.nan))
    if line.contact.bilateral or not len(local):
        return none
    segment, s = np.repeat(line.segments[local], len(PLACES)), np.tile(PLACES, len(local))
    x, d = trace.point(segment, s), trace.normal(segment, s)
    if line.contact.direction is not None:
        d = np.tile(line.contact.direction, (len(s), 1))
    opposite = partners(trace, line.facing, segment, x, d, nodes=False)
    there, s_there, distance = opposite.segment, opposite.s, opposite.distance
    if line.contact.gap is not None:
        distance = prescribed_gap(line.contact, trace, segment, s, x)
    met = np.isfinite(distance) & ((there >= 0) | (line.contact.primary is None))
    if not met.any():
        return none
    segment, there, x, d = segment[met], there[met], x[met], d[met]
    s, s_there, distance = s[met], s_there[met], distance[met]
    u = trace.evaluate(displacement, segment, s)
    noise = ROUND_OFF * (np.abs(u).max() + np.abs(x).max())
    if line.contact.primary is not None:
        u = u - trace.evaluate(displacement, there, s_there)
    gap = distance - (u * d).sum(axis=1)  # (2.10)
    deepest = int(np.argmin(gap))
    if gap[deepest] >= -noise:
        return none
    depth, [length] = -float(gap[deepest]), trace.lengths(segment[[deepest]])
    return Penetration(depth, depth / float(length), x[deepest])


Doubts = dict[tuple[str, int], str]  # messages by what is doubted and the number of the pair


def _loaded(
    space: Space, u: Array, pairs: Sequence[ContactState]
) -> Iterator[tuple[int, ContactState]]:
    """Pairs whose forces are more than round-off, with their numbers."""
    force = max((np.abs(state.force).max(initial=0.0) for state in pairs), default=0.0)
    noise = NOISE * max(np.abs(space.diagonal * u).max(initial=0.0), force)
    for number, state in enumerate(pairs):
        if np.abs(state.force).max(initial=0.0) > noise:
            yield number, state


def doubts(
    problem: Problem,
    space: Space,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
    *,
    last: bool,
) -> Doubts:
    """What may be wrong with a solution, pair by pair.

    Fixed directions far from the normals, bodies that are drawn far apart or otherwise than their
    gap is given, and strains that are not small, which no mesh mends; of the `last` mesh also zones
    in contact that are too short for it, and bodies that pass through each other between contact
    points. Of all pairs together, bodies that nothing resists.

    Parameters
    ----------
    problem : Problem
        The data.
    space : Space
        V_h of n unknowns.
    displacement : ng.GridFunction
        The displacement, a vector of n unknowns.
    pairs : sequence of ContactState
        Gaps and contact forces of each pair.
    last : bool
        Whether no finer mesh follows.
    """
    found: Doubts = {}
    u = displacement.vec.FV().NumPy()
    loaded = list(_loaded(space, u, pairs))
    for number, state in loaded:
        zones = zones_of(state)
        messages = {"strain": _large(problem, space.trace, state, zones)}
        if not messages["strain"]:  # which leaves nothing else to believe
            messages["direction"] = _inclined(space.trace, state) or apart(space.trace, state)
            messages["gap"] = contradicted(space.trace, state)
            messages["zone"] = _unresolved(state, zones) if last else ""
        name = f"contact {number} of {state.line.contact.named()}"
        found |= {(what, number): f"{name}: {text}" for what, text in messages.items() if text}
    peak = max((state.pressure.max(initial=0.0) for state in pairs), default=0.0)
    for number, state in enumerate(pairs) if last else ():  # with forces or without
        known = ("strain", number) in found
        if not known and (text := _passed(problem, space, displacement, state, peak)):
            name = f"contact {number} of {state.line.contact.named()}"
            found["penetration", number] = f"{name}: {text}"
    if not loaded and (text := _unresisted(problem, space, displacement, pairs)):
        found["rigid", 0] = text
    return found


def _unresisted(
    problem: Problem, space: Space, displacement: ng.GridFunction, pairs: Sequence[ContactState]
) -> str:
    """Message where bodies move without any deformation under no forces, or nothing."""
    u = displacement.vec.FV().NumPy()
    touching = any(state.active.any() for state in pairs)
    if not touching or not u.any():
        return ""
    if not moves_rigidly(problem, space, displacement):
        return ""
    return (
        "nothing deforms: bodies in contact move rigidly, as nothing resists them, and all contact "
        "forces are round-off; relative errors mean nothing here. Hold the body that is pushed by "
        "a support or a load if it should resist"
    )


def _inclined(trace: BoundaryTrace, state: ContactState) -> str:
    """Message where surfaces that carry force are inclined to the fixed direction, or nothing."""
    if lies_across(trace, state):
        return ""
    angle, force = inclinations(trace, state), np.abs(state.force)
    inclined = angle > INCLINED
    if force[inclined].sum() <= SHARE * force.sum():
        return ""
    xi = ", ".join(f"{component:.3g}" for component in state.line.contact.direction or ())
    return (
        f"surfaces in contact are inclined to direction=({xi}) by up to "
        f"{np.rad2deg(angle.max()):.0f} degrees, so that forces do not act along their normals; "
        "leave the direction out (direction=None), or give each flank a pair of its own direction"
    )


def _large(problem: Problem, trace: BoundaryTrace, state: ContactState, zones: Zones) -> str:
    """Message where strains are far from small, or nothing."""
    pressure = float((np.abs(zones.force) / zones.weight).max(initial=0.0))
    if stiffer_than(problem, trace.mesh, pressure / LARGE):
        return ""
    modulus = _softer(_confined_moduli, problem, trace, state)
    if pressure <= LARGE * modulus:
        return ""
    return (
        f"the mean pressure in contact, {pressure:.3g}, is {pressure / modulus:.2g} times the "
        f"modulus {modulus:.3g} of the softer body in confined compression: strains are not small; "
        "check the sign of gap (positive where bodies are apart) and the units of E, loads, lengths"
    )


def _confined_moduli(problem: Problem, mesh: ng.Mesh, asked: Mask) -> Array:
    """Kappa + mu = lambda + 2 mu (ne,), stresses."""
    return bulk_moduli(problem, mesh, asked) + shear_moduli(problem, mesh, asked)


def _softer(
    moduli: Callable[[Problem, ng.Mesh, Mask], Array],
    problem: Problem,
    trace: BoundaryTrace,
    state: ContactState,
) -> float:
    """Mean of the `moduli` along each side, of the two the smaller one; a stress."""
    sides = [trace.element[state.line.segments], trace.element[state.line.facing]]
    asked = np.zeros(trace.mesh.ne, dtype=bool)
    asked[np.concatenate(sides)] = True
    values = moduli(problem, trace.mesh, asked)
    return float(min(values[side].mean() for side in sides if len(side)))


def _unresolved(state: ContactState, zones: Zones) -> str:
    """Message where zones in contact are too short for the mesh, or nothing.

    Below `RESOLVED` the peak of Hertz's pressure is wrong by up to 70, 59, 64, 79 % at orders 1 to
    4. Contact of a whole line is resolved whatever its segments.
    """
    cut = (zones.ends > 0) & (np.abs(zones.force) > SHARE * np.abs(state.force).sum())
    needed = RESOLVED * zones.ends / (state.line.rows.shape[1] - 1)
    short = np.flatnonzero(cut & (zones.segments < needed))
    if state.line.contact.bilateral or not short.size:
        return ""
    worst = short[np.argmin(zones.segments[short] / needed[short])]
    return (
        f"a zone in contact is {zones.segments[worst]:.2g} segments long, shorter than "
        f"{needed[worst]:.2g}: the force is better than the pressure, whose peak may be wrong by "
        "half; use adapt, or a smaller maxh"
    )


def _passed(
    problem: Problem, space: Space, displacement: ng.GridFunction, state: ContactState, peak: float
) -> str:
    """Message where bodies pass through each other between contact points, or nothing.

    `peak` is the largest pressure of all pairs.
    """
    found = penetration(space.trace, displacement, state)
    if not found.depth:
        return ""
    modulus = _softer(shear_moduli, problem, space.trace, state)
    missing = modulus * found.slope
    if missing <= MISSING * peak:
        return ""
    x, y = found.place
    return (
        f"bodies pass through each other between contact points, by {found.depth:.3g} near "
        f"({x:.4g}, {y:.4g}), where no point lies: pressures of about {missing:.2g} are not seen; "
        "give the mesh a node there, or use adapt, or a smaller maxh"
    )
