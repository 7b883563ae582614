"""What may be wrong with a solution: directions, gaps, unresolved zones, large strains."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..contact import ContactState
from ..fem import BoundaryTrace, Space, bulk_moduli, shear_moduli, stiffer_than
from ..problem import Problem
from .drawn import apart, contradicted
from .estimates import moves_rigidly
from .inclinations import INCLINED, inclinations, lies_across
from .penetration import penetration
from .zones import Zones, zones_of

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
