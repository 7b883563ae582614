"""Iterative systems of one program: minimisers, work, and what sends them to a factorisation."""

import logging

import numpy as np
import pytest

from ngcontact.linalg.iterative import IterativeSystems, Limits
from ngcontact.linalg.multigrid import truncated_multigrid
from ngcontact.linalg.sparse import cholesky, congruent
from ngcontact.qp import BorderedSystems, Iterate, minimise
from tests.scenes import REFINED, discrete, steps_of


class Scene:
    """One program, its factorisation, its multigrid, and how often that was made."""

    def __init__(self, name: str, order: int, rounds: int, maxh: float = 0.5) -> None:
        self.problem = discrete(REFINED[name], order, rounds, maxh)
        self.program = self.problem.program
        space = self.problem.space
        _, self.matrix = congruent(space.matrix, space.A, space.basis @ self.problem.basis.T)
        self.factor = cholesky(self.matrix)
        self.made = 0

    def prepare(self, free):
        self.made += 1
        return truncated_multigrid(self.matrix, steps_of(self.problem, 300), free)

    def systems(self, limits=None):
        return IterativeSystems(self.program, self.factor, self.prepare, limits)

    def direct(self) -> Iterate:
        return minimise(BorderedSystems(self.program, self.factor))


def same(one: Iterate, other: Iterate) -> None:
    """Both solve the same program, to the digits that its condition leaves."""
    np.testing.assert_array_equal(one.active, other.active)
    # Measured 1e-13 to 5e-12 at 1e5 unknowns.
    np.testing.assert_allclose(one.u, other.u, rtol=0, atol=1e-10 * np.abs(other.u).max())
    np.testing.assert_allclose(one.force, other.force, rtol=0, atol=1e-10 * other.force.max())


@pytest.mark.parametrize("name", REFINED)
def test_minimisers_are_those_of_a_factor(name: str):
    scene = Scene(name, 1, 3)
    start = np.arange(len(scene.program.g)) % 2 == 0  # no motion is free from there
    result = minimise(scene.systems(), start)
    assert result.factorizations == 0
    assert result.back_solves > 10
    same(result, scene.direct())


@pytest.mark.parametrize("limits", [Limits(cycles=1), Limits(restarts=0)])
def test_systems_that_stall_are_factorised(caplog, limits: Limits):
    """In a Newton step, and in the last refinement."""
    scene = Scene("disc", 1, 3)
    with caplog.at_level(logging.INFO, logger="ngcontact"):
        result = minimise(scene.systems(limits))
    assert caplog.text.count("the matrix is factorised: ") == 1
    assert result.factorizations > 0
    same(result, scene.direct())


def test_systems_may_be_refined_in_any_order():
    """Without `solve` before, or after that of another set: the same solution."""
    scene = Scene("disc on block", 1, 2)
    m = len(scene.program.g)
    one, other = np.arange(m) < m // 2, np.arange(m) > m // 3
    known, systems = BorderedSystems(scene.program, scene.factor), scene.systems()
    for active in (one, other, one):
        u, force = systems.refine(active)
        right, forces = known.refine(active)
        np.testing.assert_allclose(u, right, rtol=0, atol=1e-10 * np.abs(right).max())
        np.testing.assert_allclose(force, forces, rtol=0, atol=1e-10 * np.abs(forces).max())
        systems.solve(one)
    assert scene.made == 1
    systems.forget()
    systems.restart(scene.program)
    assert systems.back_solves == 0
    u, _ = systems.refine(one)
    right, _ = known.refine(one)
    np.testing.assert_allclose(u, right, rtol=0, atol=1e-10 * np.abs(right).max())
    assert scene.made == 2
