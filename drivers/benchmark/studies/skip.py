"""A scene pays only for what it contains: the same scene with and without each feature."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from drivers.benchmark.studies.linear import uniform_mesh
from drivers.reference import cases
from ngcontact import Contact, Elastic, Problem, Solution, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import body, compound, polygon

SIZE = 15_000  # unknowns, about
ORDER = 2
STEEL = Elastic(E=200.0, nu=0.3)
COUNTS = ("factorizations", "back_solves", "gap_searches", "curved_elements", "estimates")


@dataclass(frozen=True)
class Scene:
    """One solution.

    Attributes
    ----------
    feature, variant : str
    unknowns, systems : int
    work : dict
        `Solution.work`, what a variant does not need being 0.
    seconds : float
    """

    feature: str
    variant: str
    unknowns: int
    systems: int
    work: dict[str, int]
    seconds: float


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


def timed(problem: Problem, mesh: ng.Mesh, estimated: bool, rounds: int) -> tuple[Solution, float]:
    """Median of several equal solutions."""
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        solution = solve(problem, mesh, order=ORDER)
        if estimated:
            _ = solution.error_estimate
        seconds.append(time.perf_counter() - start)
    return solution, float(np.median(seconds))


def scenes(rounds: int, max_dofs: int) -> Iterator[Scene]:
    """Pairs of scenes, with the feature first."""
    opening, rings = two_blocks(), cases.ring_in_ring().problem
    variants = [
        ("contact", "touching", opening, False),
        ("contact", "apart", two_blocks(gap=1.0), False),
        ("third body", "with", two_blocks(third=True), False),
        ("third body", "without", opening, False),
        ("estimate", "asked for", opening, True),
        ("estimate", "not asked for", opening, False),
        ("curved edges", "matched rings", rings, False),
        ("curved edges", "matched blocks", opening, False),
        ("gap search", "disc on block", cases.pressed_disc(), False),
        ("gap search", "matched rings", rings, False),
    ]
    for feature, variant, problem, estimated in variants:
        mesh = uniform_mesh(problem, ORDER, min(SIZE, max_dofs))
        solution, seconds = timed(problem, mesh, estimated, rounds)
        yield Scene(
            feature=feature,
            variant=variant,
            unknowns=solution.displacement.space.ndof,
            systems=len(solution.steps),
            work={name: solution.work[name] for name in COUNTS},
            seconds=seconds,
        )
