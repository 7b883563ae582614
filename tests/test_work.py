"""A scene pays only for what it contains: counts of the work done, never seconds."""

import sys

import numpy as np
import pytest

from drivers.benchmark.studies.linear import uniform_mesh
from drivers.benchmark.studies.overhead import two_blocks
from drivers.reference import cases
from ngcontact import solve
from ngcontact.mesh import first_mesh


@pytest.mark.parametrize("order", [1, 2, 4])
def test_bodies_apart_cost_one_system(order):
    solution = solve(two_blocks(gap=1.0), maxh=0.3, order=order)
    assert not solution.active.any()
    assert solution.steps == [0]
    assert solution.work["factorizations"] == 1
    assert solution.work["back_solves"] <= 3  # the load, and what round-off asks to refine


def test_what_is_not_asked_for_is_not_done():
    solution = solve(two_blocks(), maxh=0.3, order=2)
    assert solution.work["estimates"] == 0
    assert solution.work["curved_elements"] == 0
    assert solution.work["gap_searches"] == 0
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


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize(
    ("made", "most"),
    # Counted 4900 and 6000; other versions of NumPy and SciPy may call more or fewer of their own.
    [(cases.disc_on_rigid_plane, 5100), (cases.partly_opening_block, 6300)],
)
def test_a_small_level_calls_few_functions_of_python(made, most, order):
    """What a level of a thousand unknowns costs is calls: of `solve` and the estimate."""
    problem = made()
    mesh, calls = first_mesh(problem, None), 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event == "call"

    _ = solve(problem, mesh, order=order).error_estimate  # what is made once a process
    before = sys.getprofile()
    sys.setprofile(count)
    try:
        _ = solve(problem, mesh, order=order).error_estimate
    finally:
        sys.setprofile(before)
    assert 0 < calls <= most
