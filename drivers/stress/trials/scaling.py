"""Stress: units of length and stress, loads and moduli to the ends of the range of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product

import ngsolve as ng
import numpy as np

from drivers.reference.cases import FIRST, one_transition
from drivers.stress import Outcome, refused, solved
from drivers.stress.differences import differences
from drivers.stress.motion import Motion, Scene, moved_mesh, posed
from drivers.stress.trials.symmetry import cornered, disc_scene, hertz_scene, parting
from ngcontact import Contact, Elastic, Hooke, Solution, solve

SAME = 1e-10  # difference of two solutions in different units, the figure asked for
UNITS = (1e-9, 1.0, 1e9)
LOADS = (1e-300, 1e-170, 1e-100, 1e100, 1e170, 1e300)
MODULI = (1e-150, 1e150)
ORDERS = (1, 4)


def _as_it_is(scene: Scene, order: int) -> Solution:
    return solve(posed(scene, Motion("as it is"))[0], order=order)


def _scaled(scene: Scene, motion: Motion, order: int, first: Solution) -> Outcome:
    """The scaled scene against `first`, the solution of the scene as it is."""
    problem, vertex, triangle = posed(scene, motion)
    other = solve(problem, order=order)
    error = max(differences(first, other, motion, vertex, triangle).values())
    return solved(f"{scene.name}, order {order}", motion.name, other, error, SAME)


def units() -> Iterator[Outcome]:
    """Lengths and moduli times 1e-9 to 1e9: the same active sets and steps, scaled results."""
    for make, order in product((parting, hertz_scene, disc_scene, cornered), ORDERS):
        scene = make()
        first = _as_it_is(scene, order)
        for length, modulus in product(UNITS, UNITS):
            if (length, modulus) != (1, 1):
                name = f"lengths x {length:g}, moduli x {modulus:g}"
                motion = Motion(name, length=length, modulus=modulus)
                yield _scaled(scene, motion, order, first)


def loads() -> Iterator[Outcome]:
    """Loads from 1e-300 to 1e300 with the gaps that are data, moduli of 1e-150 and 1e150."""
    motions = [Motion(f"load x {load:g}", load=load) for load in LOADS]
    motions += [Motion(f"moduli x {modulus:g}", modulus=modulus) for modulus in MODULI]
    motions += [Motion(f"load, moduli x {m:g}", load=m, modulus=m) for m in MODULI]
    for make in (parting, hertz_scene, cornered):
        scene = make()
        first = _as_it_is(scene, 2)
        for motion in motions:
            yield _scaled(scene, motion, 2, first)


def beyond() -> Iterator[Outcome]:
    """Forces or displacements that no number can hold are named, not returned as 0 or NaN."""
    scene = parting()
    for load, modulus in ((1e200, 1e150), (1e-200, 1e-150)):
        varied = f"prescribed displacements x {load:g}, moduli x {modulus:g}"
        problem, *_ = posed(scene, Motion(varied, load=load, modulus=modulus))
        yield refused("S1", varied, ValueError, "range of numbers", partial(solve, problem))
    held = replace(scene, prescribed=0 * scene.prescribed)
    for load, modulus in ((1e200, 1e-150), (1e-200, 1e150)):
        varied = f"forces of {load:g}, moduli of {modulus:g}"
        law = dict.fromkeys(scene.materials, Elastic(modulus, 0.3))
        pushed = replace(held, materials=law, force={"upper": (0.0, -load)})
        problem, *_ = posed(pushed, Motion(varied))
        yield refused("S1", varied, ValueError, "range of numbers", partial(solve, problem))


def _at_some(value: float) -> ng.CoefficientFunction:
    """A function that takes `value` on part of the bodies only, seen when it is evaluated."""
    return ng.IfPos(ng.x - 0.5, ng.CF(value), ng.CF(0.0))


def _gap(value: float) -> Contact:
    """S1's pair with a function that returns `value` at some points."""
    return Contact(
        secondary="upper_contact",
        primary="lower_contact",
        gap=lambda x, y: np.where(x > 0.5, value, 0.0),
    )


def _no_numbers(value: float) -> dict[str, dict[str, object]]:
    """Arguments of `Problem` with a number that is none, by what the message must name."""
    return {
        "displacement": {"displacement": {"top": (0.0, value)}},
        "traction": {"traction": {"upper_right": value}, "displacement": {"top": (0, 0)}},
        "force": {"force": {"lower": (value, 0.0)}},
    }


def _no_values(value: float) -> dict[str, dict[str, object]]:
    """The same with functions that are none at some points."""
    here = _at_some(value)
    return {
        "displacement": {"displacement": {"top": (0.0, here)}},
        "traction": {"traction": {"upper_right": here}, "displacement": {"top": (0, 0)}},
        "force": {"force": {"lower": (here, 0.0)}},
        "gap": {"contact": [replace(_gap(0.0), gap=here)]},
        "contact[0].gap": {"contact": [_gap(value)]},
        '"upper".E': {"materials": {"upper": Elastic(here, 0.3), "lower": FIRST}},
        '"upper".nu': {"materials": {"upper": Elastic(1.0, here), "lower": FIRST}},
    }


def not_finite() -> Iterator[Outcome]:
    """NaN and infinity in every argument are refused before any assembly, by the argument."""
    problem, *_ = posed(parting(), Motion("as it is"))

    def refusal(naming: str, varied: str, run: Callable[[], object]) -> Outcome:
        return refused(f"{value} in {naming}", varied, ValueError, naming, run)

    for value in (math.nan, math.inf, -math.inf):
        for naming, change in _no_numbers(value).items():
            yield refusal(naming, "a number", partial(replace, problem, **change))
        yield refusal("E", "a number", partial(Elastic, value, 0.3))
        yield refusal("nu", "a number", partial(Elastic, 1.0, value))
        yield refusal("C", "a number", partial(Hooke, np.diag([1.0, 1.0, value])))
        yield refusal("gap", "a number", partial(Contact, "a", gap=value))
        yield refusal("direction", "a number", partial(Contact, "a", "b", (value, 1.0)))
        yield refusal("maxh", "a number", partial(solve, one_transition().problem, maxh=value))
        for naming, change in _no_values(value).items():
            changed = replace(problem, **change)  # type: ignore[arg-type]
            yield refusal(naming, "a function", partial(solve, changed))
        mesh, *_ = moved_mesh(problem.geometry, Motion("copy"))
        mesh.ngmesh.Coordinates()[0, 0] = value
        yield refusal("mesh", "a vertex", partial(solve, problem, mesh))


def outcomes() -> Iterator[Outcome]:
    """Units, loads, what is beyond numbers, what is none."""
    yield from units()
    yield from loads()
    yield from beyond()
    yield from not_finite()
