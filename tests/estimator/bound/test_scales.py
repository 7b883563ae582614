"""Directions of a law, and rings of large radius; units and motions: tests/test_similar.py."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases, cases
from ngcontact import Hooke, Problem, solve
from tests.estimator.bound.test_exact import settled
from tests.given_meshes import two_blocks


def tilted(angle, law):
    """Two blocks of given meshes pressed on each other, the upper one tilted; all turned."""
    mesh = two_blocks(np.linspace(-1, 1, 6), np.linspace(-1, 1, 8), angle)
    c, s = np.cos(angle), np.sin(angle)
    down = -0.02 - 0.01 * (c * ng.x + s * ng.y)
    return Problem(
        geometry=mesh,
        materials={"upper|lower": law},
        displacement={"bottom": (0, 0), "top": (-s * down, c * down)},
        contact=cases.one_transition().problem.contact,
    )


def turned(C, angle):
    """A law of Voigt's components in axes that are turned."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.array(
        [[c * c, s * s, -2 * s * c], [s * s, c * c, 2 * s * c], [s * c, -s * c, c * c - s * s]]
    )
    return Hooke((T @ C @ T.T).tolist())


def test_directions_of_an_anisotropic_law():
    C = np.array([[1e4, 20.0, 5.0], [20.0, 10.0, 1.0], [5.0, 1.0, 3.0]])
    one, other = (solve(tilted(a, turned(C, a)), order=2) for a in (0.0, 0.7))
    settled(other)
    assert other.relative_error_bound == pytest.approx(one.relative_error_bound, rel=1e-5)


@pytest.mark.parametrize("order", [1, 2])
def test_a_ring_of_large_radius_has_the_bound_of_the_plane(order):
    """To 1/100, radius over width; about an axis stresses are of one degree more."""

    def bound(model):
        problem = Problem(
            geometry=axisymmetric_cases.cylinders(99, 101),
            materials=cases.BLOCKS,
            displacement={"bottom": (0, 0), "top": (0, -0.02)},
            contact=[
                replace(
                    cases.one_transition().problem.contact[0],
                    direction=(0, -1),
                    gap=(ng.x - 100) ** 2 / 10,
                )
            ],
            model=model,
        )
        solution = solve(problem, maxh=0.25, order=order)
        settled(solution)
        return solution.relative_error_bound

    assert bound("axisymmetric") == pytest.approx(bound("plane strain"), rel=0.1)
