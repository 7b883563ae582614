"""Rows and prescribed conditions as single unknowns: exact algebra of the change of basis."""

from itertools import combinations

import numpy as np
import pytest

from ngcontact.arrays import from_triplets
from ngcontact.constraints.basis_transformation import change_of_basis
from ngcontact.constraints.rows import Conditions, Rows, concatenated
from ngcontact.lagrange import lagrange
from tests.constraints.given import X, Y, clamped, conditions, rows, unit


def check(given_, contact, tolerance=1e-13, **options):
    """Solve the defining equations of a basis for what holds at every y; return the basis."""
    basis = change_of_basis(given_, contact, **options)
    n, d = contact.coupling.shape[1], contact.direction.shape[1]
    T, B = basis.T.toarray(), contact.matrix.toarray()
    assert np.linalg.cond(T) < 1e8
    assert len(basis.unknown) == len(basis.kept)
    assert len(set(basis.unknown)) == len(basis.unknown)
    assert not basis.fixed[basis.unknown].any()
    # Row j of B T is the unit vector of its unknown.
    expected = np.zeros((len(basis.kept), d * n))
    expected[np.arange(len(basis.kept)), basis.unknown] = 1
    np.testing.assert_allclose(B[basis.kept] @ T, expected, atol=tolerance)
    # Conditions hold whatever the free unknowns are, and these are told from node values.
    rng = np.random.default_rng(5)
    allowed = tolerance * (1 + np.abs(basis.values).max(initial=0)) * np.linalg.cond(T)
    for _ in range(3):
        y = np.where(basis.fixed, basis.values, rng.normal(size=d * n))
        u = (T @ y).reshape(d, n).T
        left = (u[given_.node] * given_.direction).sum(axis=1)
        np.testing.assert_allclose(left, given_.value, atol=allowed)
        values = (T @ np.where(basis.fixed, 0.0, y))[:, None]
        told = basis.coordinates(values, B[basis.kept] @ values)[:, 0]
        np.testing.assert_allclose(told, np.where(basis.fixed, 0.0, y), atol=allowed)
    # As many unknowns are fixed as there are independent conditions.
    rank = 0
    for node in np.unique(given_.node):
        rank += np.linalg.matrix_rank(given_.direction[given_.node == node], tol=1e-6)
    assert np.count_nonzero(basis.fixed) == rank
    return basis


def test_corner_has_two_rows_at_one_node():
    for turn in (1e-5, 0.1, 1.5, 3.0):
        contact = rows(2, (0, unit(0.2), {1: 1.0}), (0, unit(0.2 + turn), {1: 1.0}))
        basis = check(conditions(), contact, tolerance=1e-15 / min(turn, 1))
        assert sorted(basis.unknown.tolist()) == [0, 2]


def test_one_sided_support_puts_the_row_on_the_other_side():
    contact = rows(4, (0, unit(-1.2), {1: 0.3, 2: 0.7}), (3, unit(-1.3), {2: 1.0}))
    basis = check(conditions(*clamped(0, 0.02, -0.01)), contact)
    assert basis.kept.tolist() == [0, 1]
    assert basis.unknown[0] % 4 == 2  # the larger share
    # The same with the primary prescribed: the row stays where it was.
    basis = check(conditions(*clamped(1, 1, 2), *clamped(2, 3, 4)), contact)
    assert basis.unknown.tolist() == [0, 3]


def test_guided_contact_node_has_one_free_direction():
    """Gamma_0 ends on Gamma_K: across it nothing moves, along it the row has its unknown."""
    contact = rows(2, (0, (0, -1), {1: 1.0}))
    basis = check(conditions((0, X, 0.0), (1, X, 0.0)), contact)
    assert basis.unknown.tolist() == [2]
    # Slanted: the row's direction is not the free one.
    basis = check(conditions((0, unit(0.4), 0.3), (1, unit(0.4), 0.0)), contact)
    assert basis.unknown.tolist() == [2]
    # The free direction is along the line: the row goes to the partner.
    basis = check(conditions((0, Y, 0.3)), contact)
    assert basis.unknown.tolist() == [1]


def test_row_moves_where_its_share_of_the_free_direction_is_small():
    def host(share, *more):
        d = np.array([share, -np.sqrt(1 - share**2)])
        basis = check(conditions((0, Y, 0.0), *more), rows(2, (0, d, {1: 1.0})), tolerance=1e-11)
        return int(basis.unknown[0]) % 2

    assert host(0.1) == 0
    assert host(0.01) == 1
    assert host(0.01, *clamped(1)) == 0  # it has no other


def test_same_row_twice_is_refused():
    """Two pairs that ask for the same condition leave no unknown for the second."""
    twice = rows(1, (0, Y, {}), (0, Y, {}))
    with pytest.raises(ValueError, match=r"node 0 .*depends on other contact rows"):
        change_of_basis(conditions(), twice)


def test_ring_is_refused():
    """The same pair given in both senses: one condition twice."""
    contact = rows(2, (0, (0, -1), {1: 1.0}), (1, (0, 1), {0: 1.0}))
    with pytest.raises(ValueError, match="ring"):
        change_of_basis(conditions(), contact)


@pytest.mark.parametrize("d", [(0, -1), tuple(unit(-1.2)), (1e-17, -1.0)])
def test_row_prescribed_on_both_sides_is_dropped(d):
    contact = rows(4, (0, d, {1: 1.0}), (2, d, {3: 1.0}))
    basis = check(conditions(*clamped(0, 0.5, -0.1), *clamped(1, 0.5, -0.1)), contact)
    assert basis.kept.tolist() == [1]
    # Alone, with a gap that is closed in part, exactly, or opened.
    single = rows(2, (0, d, {1: 1.0}), g=[0.2])
    for closed in (0.1, 0.2, -0.3):
        moved = np.array(d) * closed
        basis = check(conditions(*clamped(0, *moved), *clamped(1)), single)
        assert basis.kept.tolist() == []


def test_interference_is_refused():
    contact = rows(8, (7, (0, -1), {1: 1.0}), g=[0.2])
    given_ = conditions(*clamped(7, 0, -0.25), *clamped(1))
    with pytest.raises(ValueError, match=r"node 7 .*close the gap by 0.25 where it is 0.2"):
        change_of_basis(given_, contact)
    # Larger than the interpolation error, smaller than anything one sees.
    given_ = conditions(*clamped(7, 0, -0.2 - 1e-6), *clamped(1))
    with pytest.raises(ValueError, match="interference"):
        change_of_basis(given_, contact)
    check(conditions(*clamped(7, 0, -0.2 * (1 + 1e-9)), *clamped(1)), contact)


def test_round_off_of_a_measured_gap_is_no_interference():
    contact = rows(2, (0, (0, -1), {1: 1.0}), g=[-1e-17])
    given_ = conditions(*clamped(0), *clamped(1))
    assert check(given_, contact, length=1.0).kept.tolist() == []
    with pytest.raises(ValueError, match="interference"):
        change_of_basis(given_, contact, length=1e-6)


def directions(rng, *shape):
    """Random unit vectors."""
    v = rng.normal(size=shape)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def random_contact(rng, n, secondary, primary, d, order=2):
    """Rows on n nodes, of one body with partner points on another, some nodes with two rows."""
    entries = [k for k in secondary for _ in range(1 + (rng.random() < 0.3))]
    m = len(entries)
    s = rng.choice([0.0, 0.5, 1.0, rng.random()], size=m)
    first = rng.integers(0, len(primary) - order, size=m)
    facing = np.array(primary)[first[:, None] + np.arange(order + 1)]
    row = np.repeat(np.arange(m), order + 1)
    return Rows(
        node=np.array(entries),
        direction=directions(rng, m, d),
        coupling=from_triplets(lagrange(order, s).ravel(), row, facing.ravel(), (m, n)),
        g=rng.normal(size=m),
        equality=np.zeros(m, dtype=bool),
    )


def random_conditions(rng, nodes, d):
    """One to d conditions at each node, along axes or aslant."""
    count = rng.integers(1, d + 1, size=len(nodes))
    sets = [np.eye(d)[:k] if rng.random() < 0.3 else directions(rng, k, d) for k in count]
    node = np.repeat(nodes, count).astype(int)
    return Conditions(node, np.concatenate([np.zeros((0, d)), *sets]), rng.normal(size=len(node)))


def well_separated(given_, contact):
    """Whether directions at the same node differ: else the inverse loses digits by right."""
    vectors = np.concatenate([contact.direction, given_.direction])
    nodes = np.concatenate([contact.node, given_.node])
    d = vectors.shape[1]
    return all(
        np.linalg.svd(vectors[list(some)], compute_uv=False)[-1] > 0.05
        for node in np.unique(nodes)
        for k in range(2, d + 1)
        for some in combinations(np.flatnonzero(nodes == node), k)
    )


@pytest.mark.parametrize("d", [2, 3])
def test_random_pairs(d):
    """Two bodies, supported inside, at the end of the zone or on one side of it."""
    secondary, primary, inner = np.arange(5), np.arange(5, 12), np.arange(12, 16)
    for seed in range(150):
        rng = np.random.default_rng(seed)
        ends = [[], secondary[:1], primary[:2]][rng.integers(3)]
        contact = random_contact(rng, 16, secondary, primary, d)
        given_ = random_conditions(rng, [*inner, *ends], d)
        if well_separated(given_, contact):
            basis = check(given_, contact)  # measured 4e-15
            assert basis.kept.tolist() == list(range(len(contact.g)))


@pytest.mark.parametrize("d", [2, 3])
def test_random_stacks(d):
    """Three bodies: the middle one is primary to the first and secondary to the last."""
    top, middle, bottom = np.arange(4), np.arange(4, 10), np.arange(10, 15)
    for seed in range(150):
        rng = np.random.default_rng(seed)
        pairs = (top, middle), (middle[:4], bottom)
        contact = concatenated([random_contact(rng, 15, *pair, d) for pair in pairs])
        given_ = random_conditions(rng, rng.choice(bottom, size=2, replace=False), d)
        if well_separated(given_, contact):
            basis = check(given_, contact)  # measured 2e-15
            assert basis.kept.tolist() == list(range(len(contact.g)))


def test_a_ring_of_independent_rows_is_solved():
    """Both rows are fixed at their own nodes along x: each needs the unknown of the other."""
    contact = rows(2, (0, (0, -1), {1: 0.5}), (1, (0, 1), {0: 0.25}))
    basis = check(conditions((0, X, 0.0), (1, X, 0.1)), contact)
    assert basis.unknown.tolist() == [2, 3]
