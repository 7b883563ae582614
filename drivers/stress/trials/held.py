"""Bodies held by contact alone (HH81 Remark 3.7): at rest on others, lifting off, sliding away."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry

from drivers.reference import cases
from drivers.reference.straight import relative_energy_error
from drivers.stress import Outcome, refused, solved
from ngcontact import Contact, Elastic, NoEquilibriumError, Problem, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import Loop, Point, body, compound, polygon, quarter_arc

STEEL = Elastic(E=1000.0, nu=0.3)
BALANCE = 1e-12  # of forces and moments, relative to the load: round-off
RADIUS = 1.0
WEIGHT = 0.1  # of a disc, per area


def _disc(centre: Point, names: tuple[str, str, str, str]) -> Loop:
    """Circle of four quarter arcs from angle 0."""
    return [(names[k], quarter_arc(centre, RADIUS, k, (k + 1) % 4)) for k in range(4)]


def disc_above_block(gap: float = 0.05) -> tuple[Problem, float]:
    """Disc `gap` above a clamped block, with nothing but its weight; also that weight."""
    centre = (0.0, RADIUS + gap)
    base = polygon([(-2, -1), (2, -1), (2, 0), (-2, 0)], ["bottom", "side", "block_top", "side"])
    problem = Problem(
        geometry=compound(
            body("disc", _disc(centre, ("over", "over", "arc", "arc"))), body("block", base)
        ),
        materials={"disc|block": STEEL},
        displacement={"bottom": (0, 0)},
        force={"disc": (0, -WEIGHT)},
        contact=[Contact("arc", "block_top", direction=(0, -1))],
    )
    return problem, WEIGHT * math.pi * RADIUS**2


def disc_in_notch() -> tuple[Problem, float]:
    """Disc in a notch of 90 degrees whose faces it touches, one pair each; also its weight."""
    deep = math.sqrt(2) * RADIUS  # from the centre of the disc down to the root of the notch
    wide = 1.5 * deep
    low, high = -2 * deep, wide - deep
    notch = polygon(
        [(0, -deep), (-wide, high), (-wide, low), (wide, low), (wide, high)],
        ["left_face", "side", "bottom", "side", "right_face"],
    )
    geometry: OCCGeometry = compound(
        body("disc", _disc((0.0, 0.0), ("over", "over", "left_arc", "right_arc"))),
        body("notch", notch),
    )
    problem = Problem(
        geometry=geometry,
        materials={"disc|notch": STEEL},
        displacement={"bottom": (0, 0)},
        force={"disc": (0, -WEIGHT)},
        contact=[
            Contact("left_arc", "left_face", direction=(-1, -1)),
            Contact("right_arc", "right_face", direction=(1, -1)),
        ],
    )
    return problem, WEIGHT * math.pi * RADIUS**2


def stack() -> tuple[Problem, list[float]]:
    """Three blocks on each other, the lowest clamped; also the loads on the two lines."""
    names = ("base", "middle", "cap")
    bodies = []
    for level, (name, half) in enumerate(zip(names, (1.5, 1.0, 0.5), strict=True)):
        y = float(level)
        outline = polygon(
            [(-half, y), (half, y), (half, y + 1), (-half, y + 1)],
            [f"{name}_below", f"{name}_side", f"{name}_above", f"{name}_side"],
        )
        bodies.append(body(name, outline))
    problem = Problem(
        geometry=compound(*bodies),
        materials={"|".join(names): STEEL},
        displacement={"base_below": (0, 0)},
        force=dict.fromkeys(names[1:], (0, -WEIGHT)),
        traction={"cap_above": ng.CF((0, -1 - ng.x))},
        contact=[
            Contact("middle_below", "base_above", direction=(0, -1)),
            Contact("cap_below", "middle_above", direction=(0, -1)),
        ],
    )
    return problem, [1 + 3 * WEIGHT, 1 + WEIGHT]


def foundation(load: ng.CoefficientFunction) -> Problem:
    """Block of width 2 on a clamped one."""
    return Problem(
        geometry=blocks(),
        materials={"upper|lower": STEEL},
        displacement={"bottom": (0, 0)},
        traction={"top": load},
        contact=[Contact("upper_contact", "lower_contact")],
    )


def _eccentric(e: float) -> ng.CoefficientFunction:
    """Load of resultant 2 at x = e on the block of width 2."""
    return ng.CF((0, -1 - 3 * e * ng.x))


def _on_foundation() -> Iterator[Outcome]:
    for e in (0.0, 0.2, 0.32, 0.34, 0.6, 0.95):
        for order in (1, 2, 4):
            s = solve(foundation(_eccentric(e)), maxh=0.2, order=order)
            moment = (s.force * s.points[:, 0]).sum()
            error = max(abs(s.force.sum() - 2), abs(moment - 2 * e)) / 2
            yield solved("block on a foundation", f"load at {e}, order {order}", s, error, BALANCE)
    for load, motion, varied in (
        (_eccentric(1.01), "rotation", "load outside of the base"),
        (ng.CF((1e-3, -1)), "translation", "sliding load"),
        (ng.CF((0, 1)), "translation", "pulling load"),
    ):
        problem = foundation(load)
        yield refused(
            "block on a foundation",
            varied,
            NoEquilibriumError,
            f'{motion} of "upper"',
            partial(solve, problem, maxh=0.2, order=2),
        )


def _transition() -> Iterator[Outcome]:
    """S7 as in the paper: the energy error of the clamped variant's table, at its rate."""
    case = cases.guided_transition()
    for h in (0.2, 0.1, 0.05):
        s = solve(case.problem, maxh=h)
        error = relative_energy_error(s, case.exact)
        # Structured meshes have 2.61e-1 at h = 1/16 and first order; Netgen's do better.
        yield solved("S7, guided below", f"h = {h}", s, error, 2.61e-1 * 16 * h)


def _at_rest() -> Iterator[Outcome]:
    for gap in (0.0, 1e-12, 0.05, 10.0):
        problem, weight = disc_above_block(gap)
        for order in (1, 2):
            s = solve(problem, maxh=0.3, order=order)
            # Weight by quadrature of a curved disc, exact at the mesh's own area.
            disc = WEIGHT * ng.Integrate(1, s.mesh.Materials("disc"), order=4)
            error = np.abs(s.contact_force() - [0, disc]).max() / weight
            yield solved("disc by its weight", f"gap {gap}, order {order}", s, error, 1e-10)
    problem, weight = disc_in_notch()
    for order in (1, 2, 4):
        s = solve(problem, maxh=0.25, order=order)
        disc = WEIGHT * ng.Integrate(1, s.mesh.Materials("disc"), order=8)
        forces = np.array([s.contact_force(0), s.contact_force(1)])
        error = np.abs(forces - disc / 2 * np.array([[1, 1], [-1, 1]])).max() / weight
        # Symmetric within what the mesh, which is not, leaves of the moment.
        yield solved("disc in a notch", f"order {order}", s, error, 1e-10)
    problem, loads = stack()
    for order in (1, 2, 4):
        s = solve(problem, maxh=0.3, order=order)
        error = max(abs(s.contact_force(k)[1] - load) for k, load in enumerate(loads))
        yield solved("stack of three", f"order {order}", s, error / loads[0], BALANCE)


def _unloaded() -> Iterator[Outcome]:
    for gap in (None, 0.1):
        contact = [Contact("upper_contact", "lower_contact", direction=(0, -1), gap=gap)]
        s = solve(replace(foundation(ng.CF((0, 0))), contact=contact), maxh=0.3, order=2)
        yield solved("no load", f"gap {gap}", s, np.abs(s.minimiser.u).max(), 0.0)
    problem = replace(cases.clamped_transition().problem, traction={}, force={})
    yield solved(
        "no load", "clamped", s := solve(problem, maxh=0.3), np.abs(s.minimiser.u).max(), 0
    )
    pulled = replace(problem, displacement={"top": (0, 0.01), "bottom": (0, 0)})
    s = solve(pulled, maxh=0.2, order=2)
    yield solved("contact opens completely", "", s, np.abs(s.gap - 0.01).max() / 0.01, BALANCE)


def outcomes() -> Iterator[Outcome]:
    """Issue of the table: semicoercive problems and those without load."""
    yield from _transition()
    yield from _on_foundation()
    yield from _at_rest()
    yield from _unloaded()
