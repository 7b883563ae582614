"""Bodies held by contact alone (HH81 Remark 3.7): at rest on others, tipping over, sliding away."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import ngsolve as ng
import numpy as np

from drivers.reference import cases
from drivers.stress import Outcome, refused, solved
from ngcontact import Contact, Elastic, NoEquilibriumError, Problem, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import Loop, Point, body, compound, polygon, quarter_arc

STEEL = Elastic(E=1000.0, nu=0.3)
BALANCE = 1e-12  # of forces and moments, relative to the load: round-off
WEIGHT = 0.1  # of a disc of radius 1, per area


def _disc(centre: Point, *names: str) -> Loop:
    """Circle of radius 1, of four quarter arcs from angle 0."""
    return [(name, quarter_arc(centre, 1.0, k, (k + 1) % 4)) for k, name in enumerate(names)]


def disc_above_block(gap: float = 0.05) -> tuple[Problem, float]:
    """Disc `gap` above a clamped block, with nothing but its weight; also that weight."""
    disc = _disc((0.0, 1.0 + gap), "over", "over", "arc", "arc")
    base = polygon([(-2, -1), (2, -1), (2, 0), (-2, 0)], ["bottom", "side", "block_top", "side"])
    problem = Problem(
        geometry=compound(body("disc", disc), body("block", base)),
        materials={"disc|block": STEEL},
        displacement={"bottom": (0, 0)},
        force={"disc": (0, -WEIGHT)},
        contact=[Contact("arc", "block_top", direction=(0, -1))],
    )
    return problem, WEIGHT * math.pi


def disc_in_notch() -> tuple[Problem, float]:
    """Disc in a notch of 90 degrees whose faces it touches, one pair each; also its weight."""
    deep = math.sqrt(2)  # from the centre of the disc down to the root of the notch
    wide, low, high = 1.5 * deep, -2 * deep, 0.5 * deep
    notch = polygon(
        [(0, -deep), (-wide, high), (-wide, low), (wide, low), (wide, high)],
        ["left_face", "side", "bottom", "side", "right_face"],
    )
    disc = _disc((0.0, 0.0), "over", "over", "left_arc", "right_arc")
    problem = Problem(
        geometry=compound(body("disc", disc), body("notch", notch)),
        materials={"disc|notch": STEEL},
        displacement={"bottom": (0, 0)},
        force={"disc": (0, -WEIGHT)},
        contact=[
            Contact("left_arc", "left_face", direction=(-1, -1)),
            Contact("right_arc", "right_face", direction=(1, -1)),
        ],
    )
    return problem, WEIGHT * math.pi


def stack() -> tuple[Problem, list[float]]:
    """Three blocks on each other, the lowest clamped; also the loads on the two lines."""
    halves, bodies = {"base": 1.5, "middle": 1.0, "cap": 0.5}, []
    for y, (name, half) in enumerate(halves.items()):
        corners: list[Point] = [(-half, y), (half, y), (half, y + 1), (-half, y + 1)]
        sides = [f"{name}_{side}" for side in ("below", "side", "above", "side")]
        bodies.append(body(name, polygon(corners, sides)))
    problem = Problem(
        geometry=compound(*bodies),
        materials={"base|middle|cap": STEEL},
        displacement={"base_below": (0, 0)},
        force={"middle": (0, -WEIGHT), "cap": (0, -WEIGHT)},
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
        run = partial(solve, foundation(load), maxh=0.2, order=2)
        naming = f'{motion} of "upper"'
        yield refused("block on a foundation", varied, NoEquilibriumError, naming, run)


def _at_rest() -> Iterator[Outcome]:
    """Contact forces are those of the weights above them."""
    discs = [(f"disc, gap {gap}", *disc_above_block(gap)) for gap in (0.0, 1e-12, 0.05, 10.0)]
    cap, (low, high) = stack()
    unit = {"disc": np.array([[0, 1]]), "notch": np.array([[0.5, 0.5], [-0.5, 0.5]])}
    for name, problem, weight in (*discs, ("disc in a notch", *disc_in_notch())):
        for order in (1, 2):
            s = solve(problem, maxh=0.25, order=order)
            # Weight by quadrature of a curved disc, exact at the mesh's own area.
            disc = WEIGHT * ng.Integrate(1, s.mesh.Materials("disc"), order=8)
            forces = np.array([s.contact_force(k) for k in range(len(s.pairs))])
            # Symmetric within what the mesh, which is not, leaves of the moment.
            error = np.abs(forces - disc * unit[name.split(" ")[-1] if len(forces) > 1 else "disc"])
            yield solved(name, f"order {order}", s, error.max() / weight, 1e-10)
    for order in (1, 2, 4):
        s = solve(cap, maxh=0.3, order=order)
        error = max(abs(s.contact_force(k)[1] - load) for k, load in enumerate((low, high)))
        yield solved("stack of three", f"order {order}", s, error / low, BALANCE)


def outcomes() -> Iterator[Outcome]:
    """Semicoercive problems, and contact that opens completely."""
    yield from _on_foundation()
    yield from _at_rest()
    problem = replace(cases.clamped_transition().problem, traction={}, force={})
    pulled = replace(problem, displacement={"top": (0, 0.01), "bottom": (0, 0)})
    s = solve(pulled, maxh=0.2, order=2)
    yield solved("contact opens completely", "", s, np.abs(s.gap - 0.01).max() / 0.01, BALANCE)
