"""A scene pays only for what it contains: the same scene with and without each feature."""

from __future__ import annotations

import time

import ngsolve as ng
import numpy as np

from drivers.benchmark.studies import Extent
from drivers.benchmark.studies.linear import uniform_mesh
from drivers.reference import cases
from drivers.tables import of_dicts
from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import body, compound, polygon

SIZE = 15_000  # unknowns, about
ORDER = 2
STEEL = Elastic(E=200.0, nu=0.3)
COUNTS = ("factorizations", "back_solves", "gap_searches", "curved_elements", "estimates")


def two_blocks(gap: float | None = None, third: bool = False) -> Problem:
    """Blocks under a pressure that opens a part of their contact; `gap` keeps them apart."""
    geometry = blocks()
    materials = {"upper": STEEL, "lower": STEEL}
    displacement: dict[str, tuple[float, float]] = {"bottom": (0, 0), "upper_left": (0, 0)}
    if third:
        corners = [(3.0, -1.0), (5.0, -1.0), (5.0, 1.0), (3.0, 1.0)]
        names = ["third_bottom", "third_side", "third_top", "third_side"]
        geometry = compound(geometry.shape, body("third", polygon(corners, names)))
        materials["third"] = STEEL
        displacement["third_bottom"] = (0, 0)
    return Problem(
        geometry=geometry,
        materials=materials,
        displacement=displacement,
        traction={"top": 1.0 - 3 * ng.x},
        contact=[Contact("upper_contact", "lower_contact", direction=(0, -1), gap=gap)],
    )


def scenes(extent: Extent) -> tuple[list[dict[str, object]], str]:
    """What scenes skip."""
    opening, rings = two_blocks(), cases.ring_in_ring().problem
    found: list[dict[str, object]] = []
    for feature, variant, problem in (
        ("contact", "touching", opening),
        ("contact", "apart", two_blocks(gap=1.0)),
        ("third body", "with", two_blocks(third=True)),
        ("third body", "without", opening),
        ("estimate", "asked for", opening),
        ("estimate", "not asked for", opening),
        ("curved edges", "matched rings", rings),
        ("curved edges", "matched blocks", opening),
        ("gap search", "disc on block", cases.pressed_disc()),
        ("gap search", "matched rings", rings),
    ):
        mesh, seconds = uniform_mesh(problem, ORDER, min(SIZE, extent.max_dofs)), []
        for _ in range(extent.rounds):
            start = time.perf_counter()
            solution = solve(problem, mesh, order=ORDER)
            if variant == "asked for":
                _ = solution.error_estimate
            seconds.append(time.perf_counter() - start)
        found.append(
            {
                "feature": feature,
                "scene": variant,
                "unknowns": solution.displacement.space.ndof,
                "systems": len(solution.steps),
                **{name.replace("_", " "): solution.work[name] for name in COUNTS},
                "s": f"{np.median(seconds):.3g}",
            }
        )
    return found, of_dicts(found)
