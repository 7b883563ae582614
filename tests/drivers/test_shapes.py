"""Stretched and sliver elements: aspect ratios up to 1e4, angles of 0.1 and 179 degrees.

Errors are compared with what the mesh can do: order 1 reproduces a constant pressure, and the error
of S1 and S3 is bounded by that of the interpolant. The latter needs no constant: the interpolant
lies in K_h and has the values of u_h on Gamma_u, so that L(u_h) <= L(Iu) gives

    |u - u_h|^2 <= |u - Iu|^2 + 2 integral of p (gap(Iu) - gap(u_h)).

At order 1 the difference of the gaps is at most the interpolant of the gap of u, which vanishes
wherever p does not when nodes lie at the ends of the contact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import netgen.meshing as nm
import ngsolve as ng
import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.reference.cases import BLOCKS, FIRST, OUTSIDE, SECOND
from drivers.reference.straight import Exact, Hertz, hertz, patch, relative_energy_error, transition
from drivers.stress import Outcome
from ngcontact import Contact, Problem, Solution, solve

Array = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]
Move: TypeAlias = Callable[[float, float], Point]

FACTORS = (1e2, 1e3, 1e4)
CELLS = 8  # along x and y of each block; a node at the end of the contact, x = 0
HALF_WIDTH = 2 / CELLS  # of the contact of S3, between two nodes
PATCH = 1e-9  # of an exactly represented stress
EPS = np.finfo(float).eps
SIDES = ("contact", "right", "top", "left")


def solved(case, varied, solution, error, allowed):
    """A row of a test that makes many: what is solved and varied, the error and what is allowed."""
    residual = max(solution.residuals.values())
    return Outcome(case, varied, len(solution.steps), residual, float(error), allowed)


def structured(x: Array, y: Array, move: Move = lambda x, y: (x, y)) -> ng.Mesh:
    """Mesh of two blocks, names as in `geometries.blocks`, on a grid x (n,) by y (m,), y[0] = 0.

    `move` maps the points of the upper block; the lower one is its mirror image.
    """
    mesh = nm.Mesh()
    mesh.dim = 2
    for body, (name, side) in enumerate((("upper", 1), ("lower", -1))):
        mesh.Add(nm.FaceDescriptor(surfnr=body + 1, domin=body + 1, domout=0, bc=body + 1))
        mesh.SetMaterial(body + 1, name)
        moved = ([move(float(a), float(b)) for a in x] for b in y)
        grid = [[mesh.Add(nm.MeshPoint(nm.Pnt(a, side * b, 0))) for a, b in row] for row in moved]
        for below, above in pairwise(grid):
            for i in range(len(x) - 1):
                for t in (
                    [below[i], below[i + 1], above[i + 1]],
                    [below[i], above[i + 1], above[i]],
                ):
                    mesh.Add(nm.Element2D(body + 1, t[::side]))
        lines = [grid[0], [r[-1] for r in grid], grid[-1][::-1], [r[0] for r in grid][::-1]]
        for number, nodes in enumerate(lines):
            for pair in pairwise(nodes):
                mesh.Add(nm.Element1D(list(pair[::side]), index=4 * body + number + 1))
    ends = {"upper_top": "top", "lower_top": "bottom"}
    names = [f"{body}_{side}" for body in ("upper", "lower") for side in SIDES]
    for number, name in enumerate(names):
        mesh.SetBCName(number, ends.get(name, name))
    return ng.Mesh(mesh)


def over_the_best(solution: Solution, exact: Exact) -> float:
    """Error in energy over that of the interpolant of the exact displacement."""
    u = ng.GridFunction(solution.displacement.space)
    u.Set(solution.mesh.MaterialCF(exact.displacement), dual=True)
    best = relative_energy_error(replace(solution, displacement=u), exact)
    return relative_energy_error(solution, exact) / best


def touching(mesh: ng.Mesh, exact: Exact, ends_only: bool = False) -> Problem:
    """Blocks without gap, the exact displacement given outside, or at top and bottom."""
    ends = {"upper": "top", "lower": "bottom"}
    where = ends if ends_only else OUTSIDE
    return Problem(
        geometry=mesh,
        materials=BLOCKS,
        displacement={where[body]: u for body, u in exact.displacement.items()},
        contact=[Contact(secondary="upper_contact", primary="lower_contact")],
    )


def pressed(mesh: ng.Mesh, exact: Hertz) -> Problem:
    """S3 on a mesh of two blocks, moved so that the contact ends where it did at x = 0."""
    moved = ng.Mesh(mesh.ngmesh.Copy())
    moved.ngmesh.Coordinates()[:, 0] += exact.half_width
    contact = Contact("lower_contact", "upper_contact", (0, 1), gap=exact.initial_gap)
    return replace(touching(moved, exact), contact=[contact])


def meshes() -> Iterator[tuple[str, ng.Mesh, float, bool]]:
    """Name, mesh, aspect ratio and slenderness of stretched meshes and of those with a sliver."""
    x, y = np.linspace(-1, 1, CELLS + 1), np.linspace(0, 1, CELLS + 1)
    for factor in FACTORS:
        # Narrow columns about the end of the contact, and thin layers along the contact.
        half = np.concatenate([[0.0], np.geomspace(1 / (CELLS * factor), 1, 12)])
        columns = np.union1d(np.concatenate([-half[:0:-1], half]), [-2 * HALF_WIDTH])
        layers = np.concatenate([[0.0], np.geomspace(1 / (CELLS * factor), 1, CELLS)])
        yield f"columns compressed by {factor:g}", structured(columns, y), factor, False
        yield f"layers compressed by {factor:g}", structured(x, layers), factor, False
        yield f"x compressed by {factor:g}", structured(x / factor, y), factor, True
        yield f"y compressed by {factor:g}", structured(x, y / factor), factor, False
    dx, dy = x[1] - x[0], y[1] - y[0]

    def moving(corner: Point, to: Point) -> Move:
        return lambda a, b: to if np.allclose((a, b), corner) else (a, b)

    # One extreme triangle at the end of the contact: the apex of that on 0 <= x <= dx is lowered,
    # or the contact segment that starts at x = 0 is shortened.
    for angle in (179.0, 179.8):  # the second one has two angles of 0.1 degrees
        flat = moving((dx, dy), (dx / 2, dx / 2 / math.tan(math.radians(angle / 2))))
        yield f"angle of {angle:g} degrees", structured(x, y, flat), 1.0, False
    needle = moving((dx, 0.0), (dy * math.tan(math.radians(0.1)), 0.0))
    yield "angle of 0.1 degrees", structured(x, y, needle), 1.0, False


@pytest.mark.study(witness=["1-0", "2-14"])
@pytest.mark.parametrize("number", range(15))
@pytest.mark.parametrize("order", [1, 2])
def test_errors_follow_the_interpolation_error(order, number):
    """Constant pressure, one transition and Hertz contact on all meshes."""
    _, mesh, aspect, slender = list(meshes())[number]
    uniform, parting = patch(FIRST, SECOND), transition(FIRST, SECOND)
    # A slender body is held at its sides too: its bending is as soft as 1 / aspect^2.
    s = solve(touching(mesh, uniform, ends_only=not slender), order=order)
    assert relative_energy_error(s, uniform) <= PATCH
    # Forces are what is left of terms of size E aspect times the displacement, at nodes whose share
    # of the boundary is 1 / aspect: known to eps aspect^2.
    assert np.abs(s.pressure - 1).max() <= max(PATCH, EPS * aspect**2)
    # Over the best, order 1: 1 by the theory above. Order 2: 0.15 to 0.95 measured.
    assert over_the_best(solve(touching(mesh, parting), order=order), parting) <= 1.0
    if not slender:
        pressing = hertz(FIRST, SECOND, radius=5.0, half_width=HALF_WIDTH)
        s = solve(pressed(mesh, pressing), order=order)
        assert over_the_best(s, pressing) <= 1.0
