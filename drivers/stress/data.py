"""Stress: random data that the mesh does not resolve; estimate and bound against the true error.

Narrow and waving loads, displacements with kinks and waves, moduli that vary inside elements and
jump between bodies, anisotropy along turned axes, interference. The error is that of the stress
against an adaptive solution of order 4.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np
from netgen.occ import Glue, OCCGeometry

from drivers.reference.laws import fibres
from drivers.reference.overkill import Overkill
from drivers.stress import Outcome
from drivers.tables import table
from ngcontact import Contact, ContactWarning, Elastic, Hooke, Problem, Solution, adapt, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import Point, body, compound, polygon

Draw = np.random.Generator

LEAST = 0.9  # estimate, or bound, over error, which is known up to that of the overkill solution
LOST = 1e-2  # of a load that the supports may not feel
SHARP = 0.05  # estimate of the overkill solution over that of the one it judges
DOFS = 8_000  # of the overkill solution


@dataclass(frozen=True)
class Drawn:
    """A scene, and the force (2,) of its loads where that is known.

    `resolved` is the same scene with edges of the geometry where its data jump, if it has one:
    what the finer solution is of, which must not depend on the quadrature that is tried.
    """

    problem: Problem
    load: tuple[float, float] | None = None
    resolved: Problem | None = None


@dataclass(frozen=True)
class DataOutcome(Outcome):
    """The line of one scene: its kind, estimate over error, and what was told."""

    kind: str
    effectivity: float
    warned: bool
    refused: bool  # no bound


def _square(*strip: float) -> OCCGeometry:
    """Unit square; the part of the top between two abscissae is "loaded"."""
    top: list[Point] = [(x, 1.0) for x in strip[::-1]]
    names = ["bottom", "right", "top", *(["loaded", "top"] if strip else []), "left"]
    face = body("body", polygon([(0, 0), (1, 0), (1, 1), *top, (0, 1)], names))
    return compound(face)


def square(draw: Draw) -> Problem:
    """A clamped square under a uniform load."""
    return Problem(
        geometry=_square(),
        materials={"body": Elastic(1.0, float(draw.uniform(0, 0.4)))},
        displacement={"bottom": (0, 0)},
        traction={"top": (float(draw.uniform(-1, 1)), -1.0)},
    )


def _inside(x: ng.CoefficientFunction, middle: float, half: float) -> ng.CoefficientFunction:
    """1 where |x - middle| < half, else 0."""
    return ng.IfPos(half * half - (x - middle) ** 2, 1.0, 0.0)


def narrow_traction(draw: Draw) -> Drawn:
    """A pressure of force 1 on a strip from a thousandth of a side on."""
    half = float(10 ** draw.uniform(-3, -1))
    middle = float(draw.uniform(half, 1 - half))
    scene, p = square(draw), 1 / (2 * half)
    resolved = replace(
        scene, geometry=_square(middle - half, middle + half), traction={"loaded": p}
    )
    rough = replace(scene, traction={"top": p * _inside(ng.x, middle, half)})
    return Drawn(rough, (0.0, -1.0), resolved)


def small_force(draw: Draw) -> Drawn:
    """A body force of 1 on a disc."""
    r = float(10 ** draw.uniform(-2, -0.7))
    x, y = draw.uniform(r, 1 - r, 2).tolist()
    F = _inside(ng.sqrt((ng.x - x) ** 2 + (ng.y - y) ** 2), 0.0, r) / (math.pi * r * r)
    return Drawn(replace(square(draw), traction={}, force={"body": (0, -F)}), (0.0, -1.0))


def waving_traction(draw: Draw) -> Drawn:
    """A pressure with up to twenty waves."""
    n = int(draw.integers(1, 21))
    p = 1 + float(draw.uniform(0, 3)) * ng.cos(2 * math.pi * n * ng.x)
    return Drawn(replace(square(draw), traction={"top": p}), (0.0, -1.0))


def rough_displacement(draw: Draw) -> Drawn:
    """The top moved down, with up to twenty waves or a kink."""
    a, k = float(draw.uniform(0.002, 0.02)), float(draw.uniform(3, 120))
    kink = ng.sqrt((ng.x - float(draw.uniform(0, 1))) ** 2)
    u = -0.01 + a * (ng.cos(k * ng.x) if draw.random() < 0.6 else kink)
    data = {"bottom": (0, 0), "top": (None, u)}
    return Drawn(replace(square(draw), traction={}, displacement=data))


def varying_modulus(draw: Draw) -> Drawn:
    """E = exp(a cos(k x')), of contrasts up to 100, in any direction x'."""
    turn, k = draw.uniform(0, math.pi), float(draw.uniform(1, 5))
    along = math.cos(turn) * ng.x + math.sin(turn) * ng.y
    E = ng.exp(float(draw.uniform(0, math.log(10))) * ng.cos(k * along))
    return Drawn(replace(square(draw), materials={"body": Elastic(E, 0.3)}))


def _split(left: float, right: float, *names: str) -> OCCGeometry:
    """Unit square with an edge from (0, left) to (1, right); the parts below and above, glued."""
    below = polygon([(0, 0), (1, 0), (1, right), (0, left)], ["bottom", "right", "between", "left"])
    above = polygon([(0, left), (1, right), (1, 1), (0, 1)], ["between", "right", "top", "left"])
    faces = (body(name, loop) for name, loop in zip(names, (below, above), strict=True))
    return OCCGeometry(Glue(list(faces)), dim=2)


def _modulus_above(draw: Draw) -> tuple[tuple[float, float], float]:
    """Heights of a line on both sides of the square, and a modulus above it; 1 below."""
    left, right = draw.uniform(0.15, 0.85, 2).tolist()
    return (left, right), float(10 ** draw.uniform(-3, 3))


def glued_layers(draw: Draw) -> Drawn:
    """Moduli that jump by up to 1e3 across an edge of the geometry."""
    ends, E = _modulus_above(draw)
    laws = {"below": Elastic(1.0, float(draw.uniform(0, 0.4))), "above": Elastic(E, 0.3)}
    geometry = _split(*ends, "below", "above")
    return Drawn(replace(square(draw), geometry=geometry, materials=laws))


def jumping_modulus(draw: Draw) -> Drawn:
    """The same jumps where there is no edge: a warning asks for one."""
    (left, right), above = _modulus_above(draw)
    E = ng.IfPos(ng.y - left - (right - left) * ng.x, above, 1.0)
    scene = replace(square(draw), materials={"body": Elastic(E, 0.3)})
    resolved = replace(scene, geometry=_split(left, right, "body", "body"))
    return Drawn(scene, resolved=resolved)


def anisotropy(draw: Draw) -> Drawn:
    """Fibres up to 1e4 times stiffer, at any angle; as numbers or as functions."""
    a = draw.uniform(0, math.pi)
    law = fibres(float(10 ** draw.uniform(0, 4)), a, float(draw.uniform(0.3, 1)))
    law = Hooke(law.voigt()) if draw.random() < 0.5 else law
    return Drawn(replace(square(draw), materials={"body": law}))


def interference(draw: Draw) -> Drawn:
    """Blocks of other stiffness with a gap that waves and overlaps, unilateral or bilateral."""
    n, size = int(draw.integers(1, 6)), float(draw.uniform(0.002, 0.02))
    gap = size * (float(draw.uniform(-1, 0.3)) + ng.cos(n * math.pi * ng.x))
    bilateral = bool(draw.random() < 0.4)
    return Drawn(
        Problem(
            geometry=blocks(),
            materials={
                "upper": Elastic(float(10 ** draw.uniform(-3, 3)), 0.3),
                "lower": Elastic(1.0, float(draw.uniform(0, 0.4))),
            },
            displacement={"top": (0, -0.005), "bottom": (0, 0)},
            contact=[Contact("upper_contact", "lower_contact", gap=gap, bilateral=bilateral)],
        )
    )


KINDS: tuple[Callable[[Draw], Drawn], ...] = (
    narrow_traction,
    small_force,
    waving_traction,
    rough_displacement,
    varying_modulus,
    anisotropy,
    interference,
    glued_layers,
    jumping_modulus,
)


def finest(problem: Problem, estimate: float) -> Solution:
    """An adaptive solution of order 4 whose estimate, absolute, is far below another's."""
    for solution in adapt(problem, order=4, max_dofs=DOFS):
        if solution.error_estimate <= SHARP * estimate:
            break
    return solution


def outcome(seed: int) -> DataOutcome:
    """The scene of a seed: what the estimate, the bound, and the supports lack.

    A warning excuses all but the bound.
    """
    draw = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    drawn, order = kind(draw), int(draw.integers(1, 4))
    maxh = float(draw.uniform(0.12, 0.3)) * (1 if order > 1 else 0.5)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ContactWarning)
        solution = solve(drawn.problem, maxh=maxh, order=order)
        estimate = solution.error_estimate
    warned = any(issubclass(w.category, ContactWarning) for w in caught)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)
        reference = finest(drawn.resolved or drawn.problem, estimate)
    error = Overkill(reference).relative_error(solution) * reference.energy_norm
    ratio, bound = estimate / error, math.inf
    with contextlib.suppress(ValueError):  # refused by name where the mesh does not resolve data
        bound = solution.error_bound / error
    lack = max(LEAST / ratio, LEAST / bound)
    if drawn.load is not None:
        force = solution.reactions["bottom"]
        lack = max(lack, math.hypot(*(force + np.array(drawn.load))) / LOST)
    return DataOutcome(
        f"{kind.__name__}, order {order}, seed {seed}",
        f"estimate / error {ratio:.2f}, bound "
        f"{f'{bound:.2f}' if bound < math.inf else 'refused'}{', warned' if warned else ''}",
        steps=len(solution.steps),
        residual=max(solution.residuals.values()),
        error=lack,
        allowed=math.inf if warned and bound >= LEAST else 1.0,
        kind=kind.__name__,
        effectivity=ratio,
        warned=warned,
        refused=bound == math.inf,
    )


def summary(found: Sequence[Outcome]) -> Iterator[str]:
    """Table of all scenes by kind: how many, how many warned, effectivities."""
    rows = []
    for kind in KINDS:
        mine = [o for o in found if isinstance(o, DataOutcome) and o.kind == kind.__name__]
        if mine:
            ratio = np.array([o.effectivity for o in mine])
            figures = (f"{f(ratio):.2f}" for f in (np.min, np.median, np.max))
            told = sum(o.warned for o in mine), sum(o.refused for o in mine)
            rows.append((kind.__name__, len(mine), *told, *figures))
    yield table(("data", "scenes", "warned", "refused", "least", "median", "largest"), rows)


def outcomes(seed: int = 0, count: int = 66) -> Iterator[DataOutcome]:
    """The scenes of `count` seeds from `seed` on."""
    return map(outcome, range(seed, seed + count))
