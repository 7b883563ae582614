"""A scene pays only for what it contains: counts of the work done, never seconds."""

import ngsolve as ng
import numpy as np
import pytest

from drivers.benchmark.studies.linear import uniform_mesh
from drivers.reference import cases
from ngcontact import Contact, solve
from ngcontact.mesh import first_mesh
from tests.runs import recorded


def two_blocks(gap=None):
    """Blocks under a pressure that opens a part of their contact; `gap` keeps them apart."""
    contact = Contact("upper_contact", "lower_contact", direction=(0, -1), gap=gap)
    held = {"bottom": (0, 0), "upper_left": (0, 0)}
    return cases.touching_blocks(held, traction={"top": 1.0 - 3 * ng.x}, contact=[contact])


@pytest.mark.parametrize("order", [1, 2, 4])
def test_bodies_apart_cost_one_system(order):
    solution = solve(two_blocks(gap=1.0), maxh=0.3, order=order)
    assert not solution.active.any()
    assert solution.steps == [0]
    assert solution.work["factorizations"] == 1
    assert solution.work["back_solves"] <= 3  # the load, and what round-off asks to refine


def test_the_estimate_is_made_once_when_it_is_asked_for():
    solution = solve(two_blocks(), maxh=0.3, order=2)
    assert solution.work["estimates"] == 0
    _ = solution.indicators, solution.error_estimate, solution.relative_error_estimate
    assert solution.work["estimates"] == 1


@pytest.mark.study
def test_a_large_cold_start_follows_a_coarse_run():
    problem = cases.disc_on_rigid_plane()
    mesh = uniform_mesh(problem, 2, 30_000)
    solution = solve(problem, mesh, order=2)
    assert solution.coarse_levels > 2
    assert solution.work["assemblies"] == solution.work["factorizations"] == 1
    assert len(solution.steps) <= 2
    # A mesh that the user made as the geometry leaves nothing to mesh coarsely.
    given = solve(cases.replace(problem, geometry=mesh), mesh, order=2)
    assert given.coarse_levels == 0
    np.testing.assert_array_equal(given.active, solution.active)
    u, v = (s.displacement.vec.FV().NumPy() for s in (given, solution))
    # Two factorisations of other active sets: round-off times the condition, about 1e5.
    np.testing.assert_allclose(u, v, rtol=0, atol=1e-10 * np.abs(v).max())


@pytest.mark.parametrize(
    ("made", "order", "most"),
    # Counted 3760, 3890, 5290, 5980; other versions of NumPy and SciPy may call more of their own.
    [
        (cases.disc_on_rigid_plane, 2, 3870),
        (cases.disc_on_rigid_plane, 4, 4010),
        (cases.partly_opening_block, 2, 5340),
        (cases.partly_opening_block, 4, 6160),
    ],
)
def test_a_small_level_calls_few_functions_of_python(made, order, most):
    """What a level of a thousand unknowns costs is calls: of `solve` and the estimate."""
    problem = made()
    mesh = first_mesh(problem, None)
    _ = solve(problem, mesh, order=order).error_estimate  # what is made once a process
    mesh = ng.Mesh(mesh.ngmesh.Copy())  # of which nothing is known yet
    with recorded() as calls:
        _ = solve(problem, mesh, order=order).error_estimate
    assert 0 < len(calls) <= most
