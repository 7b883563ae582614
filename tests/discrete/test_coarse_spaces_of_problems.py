"""Coarser spaces of contact problems: inside the finer ones, as small as they should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from drivers.reference import cases
from ngcontact.adaptivity.refinement import refined
from ngcontact.discrete.discrete_problem import DiscreteProblem, discretise
from ngcontact.lagrange import gauss_lobatto
from ngcontact.mesh.generation import first_mesh
from tests.scenes import REFINED, coordinates, discrete, near_origin, steps_of


def linear_field(problem: DiscreteProblem) -> np.ndarray:
    """Node values of a linear displacement, edge functions 0, (2n,)."""
    trace = problem.space.trace
    xy = coordinates(trace.mesh)
    points = np.zeros((trace.space.ndof, 2))
    points[: len(xy)] = xy
    present = np.zeros(len(points))
    present[: len(xy)] = 1.0
    for s, nodes in zip(
        gauss_lobatto(trace.order)[1:-1], trace.nodes[problem.space.nodal].T[1:-1], strict=True
    ):
        start, stop = trace.nodes[problem.space.nodal][:, [0, -1]].T
        points[nodes] = (1 - s) * xy[start] + s * xy[stop]
        present[nodes] = 1.0
    u = points @ np.array([[0.3, -0.7], [1.1, 0.2]]) + present[:, None] * np.array([0.5, -0.4])
    return u.T.ravel()


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_linear_displacements_are_in_all_spaces(order: int):
    problem = discrete(cases.partly_opening_block(), order, 3)
    y = sp.linalg.spsolve(problem.basis.T.tocsc(), linear_field(problem))
    steps = steps_of(problem)
    assert len(steps) > 2
    for step in steps:
        # Theory: exact, on straight bodies; 100 times round-off.
        np.testing.assert_allclose(step.P @ y[step.kept], y, rtol=0, atol=1e-14)
        y = y[step.kept]


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("name", REFINED)
def test_unknowns_that_stay_mean_the_same(name: str, order: int):
    """Of rows at nodes: the mean of a dual row contains unknowns that do not stay."""
    pairs = [replace(pair, rows="nodal") for pair in REFINED[name].contact]
    problem = discrete(replace(REFINED[name], contact=pairs), order, 2)
    for step in steps_of(problem):
        chosen = step.P[step.kept]
        # Theory: the identity, to round-off of the frames; pairs that refinement did not match
        # exactly refer to other partners.
        assert abs(chosen - sp.eye_array(chosen.shape[0])).max() < 1e-12


@pytest.mark.parametrize("local", [False, True])
def test_spaces_shrink_geometrically(local: bool):
    mesh = first = first_mesh(REFINED["block"], 0.5)
    for _ in range(6 if local else 3):
        mesh = refined(REFINED["block"], mesh, near_origin(mesh, 0.3) if local else None)
    problem = discretise(REFINED["block"], mesh, 1, "isoparametric")
    sizes = [step.P.shape for step in steps_of(problem, 0)]
    assert all(k <= n / 2 for n, k in sizes)
    assert sizes[0][0] == 2 * mesh.nv
    assert 2 * first.nv <= sizes[-1][1] <= (4 if local else 2) * first.nv  # the first mesh at last
