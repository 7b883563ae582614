"""Systems by few factorisations: bordering is exact, remembers, forgets, keeps one factor."""

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.qp.active_set import minimise, solve_qp
from ngcontact.qp.schur_complement import BorderedSystems
from tests.qp.programs import counting_factor, first_unknowns_bounded, membrane


@pytest.mark.parametrize("border", [0, 5, 1000])
def test_bordering_equals_refactorising(border):
    """Unit rows: bordered systems give the solution that a new factor for each set gives."""
    K, b, g = membrane()
    n = g.size
    flip = sp.eye_array(n, format="csr")
    program = first_unknowns_bounded(K, -b, g)
    calls = []
    start = np.zeros(n, dtype=bool)
    start[::2] = True
    result = minimise(BorderedSystems(program, counting_factor(K, calls), border), start)
    reference = solve_qp(K, -b, flip, g)
    np.testing.assert_array_equal(result.active, reference.active)
    np.testing.assert_allclose(result.u, reference.u, rtol=1e-11)
    np.testing.assert_allclose(result.force, reference.force, atol=1e-11 * reference.force.max())
    assert len(calls) == result.factorizations
    if border == 1000:
        assert result.factorizations == 1
    # Free boundary of -u'' = -1 over the obstacle -0.02: contact where x is in [0.2, 0.8].
    contact = np.flatnonzero(result.active) + 1
    assert abs(contact[0] / (n + 1) - 0.2) <= 1 / (n + 1)
    assert abs(contact[-1] / (n + 1) - 0.8) <= 1 / (n + 1)


@pytest.mark.parametrize("stiffness", [1e-9, 2.1e11])
def test_bordered_systems_do_not_depend_on_the_stiffness(stiffness):
    """Added rows border with compliances, released rows with stiffnesses: both must count."""
    rng = np.random.default_rng(5)
    n, m = 12, 6
    for _ in range(50):
        X = rng.normal(size=(n, n + 2))
        K, b, g = sp.csr_array(X @ X.T), rng.normal(size=n), 0.3 * rng.normal(size=m)
        rows = sp.eye_array(n, format="csr")[:m]
        program = first_unknowns_bounded(stiffness * K, stiffness * b, g)
        result = minimise(
            BorderedSystems(program, counting_factor(program.K, [])), rng.random(m) < 0.5
        )
        reference = solve_qp(K, b, rows, g)
        np.testing.assert_array_equal(result.active, reference.active)
        # Condition of these matrices up to 1e5: round-off 1e-10.
        np.testing.assert_allclose(result.u, reference.u, atol=1e-9)


def random_bounds(seed):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(12, 14))
    return first_unknowns_bounded(sp.csr_array(X @ X.T), rng.normal(size=12), rng.normal(size=6))


def test_systems_may_be_refined_in_any_order():
    """Without `solve` before, after that of another set, twice: the same solution."""
    program = random_bounds(8)
    one, other = np.arange(6) < 2, np.arange(6) > 3
    expected = {}
    for active in (one, other):
        systems = BorderedSystems(program, counting_factor(program.K, []))
        systems.solve(active)
        expected[active.tobytes()] = systems.solve(active, refined=True)
    systems = BorderedSystems(program, counting_factor(program.K, []))
    for active in (one, other, other, one):
        for found, right in zip(
            systems.solve(active, refined=True), expected[active.tobytes()], strict=True
        ):
            # Condition of the matrix up to 1e4, entries of size 1.
            np.testing.assert_allclose(found, right, rtol=0, atol=1e-11)
        systems.solve(one)


def test_the_dense_program_of_all_rows_is_the_whole():
    """From any active set, with more back-solves than a factorisation costs."""
    rng = np.random.default_rng(3)
    for seed in range(50):
        program = random_bounds(seed)
        systems = BorderedSystems(program, counting_factor(program.K, []), border=0)
        systems.solve(rng.random(6) < 0.5)
        active = systems.complementary(np.ones(6, dtype=bool))
        np.testing.assert_array_equal(active, minimise(systems).active)
        systems.solve(active)
        assert systems.factorizations == 1
