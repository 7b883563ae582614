"""Rows and conditions as arrays, and as single unknowns: exact algebra of the change of basis."""

from itertools import combinations

import numpy as np
import pytest

from ngcontact.arrays import from_triplets, joined
from ngcontact.constraints import STIFFNESS_CONTRAST, Conditions, Rows, change_of_basis
from ngcontact.lagrange import lagrange

X, Y = (1.0, 0.0), (0.0, 1.0)


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def conditions(*entries):
    """Conditions from (node, direction, value)."""
    if not entries:
        return Conditions(np.zeros(0, dtype=int), np.zeros((0, 2)), np.zeros(0))
    node, direction, value = zip(*entries, strict=True)
    return Conditions(np.array(node), np.array(direction, dtype=float), np.array(value, float))


def clamped(node, ux=0.0, uy=0.0):
    return (node, X, ux), (node, Y, uy)


def rows(n, *entries, g=None):
    """Rows on n nodes from (node, direction, {facing node: weight})."""
    m = len(entries)
    shares = [(j, k, c) for j, (_, _, facing) in enumerate(entries) for k, c in facing.items()]
    row, column, weight = np.array(shares).reshape(-1, 3).T
    return Rows(
        node=np.array([e[0] for e in entries], dtype=int),
        direction=np.array([e[1] for e in entries], dtype=float).reshape(m, 2),
        coupling=from_triplets(weight, row, column, (m, n)),
        g=np.zeros(m) if g is None else np.array(g, dtype=float),
        equality=np.zeros(m, dtype=bool),
    )


def test_matrix_of_rows():
    contact = rows(4, (0, (0.6, 0.8), {2: 0.25, 3: 0.75}), (1, X, {}))
    B = contact.matrix
    expected = [[0.6, 0, -0.15, -0.45, 0.8, 0, -0.2, -0.6], [0, 1, 0, 0, 0, 0, 0, 0]]
    np.testing.assert_allclose(B.toarray(), expected, atol=1e-16)
    assert B.nnz == 7  # nothing stored where the partner has no share
    assert rows(3).matrix.shape == (0, 6)


def test_rows_with_one_left_side_are_alike():
    d = unit(0.7)
    alike = (1, d, {3: 0.5, 4: 0.5}), (1, d + 1e-12, {3: 0.5, 4: 0.5}), (1, d, {3: 0.4, 4: 0.6})
    contact = rows(5, (0, d, {3: 1.0}), *alike, (2, d, {4: 1.0}))
    assert [contact.alike(1, k) for k in range(5)] == [False, True, True, False, False]


def hosts(contact, given=None, stiffness=None):
    """Host node of each row, (m,)."""
    basis = change_of_basis(given or conditions(), contact, stiffness=stiffness)
    return (basis.unknown % contact.coupling.shape[1]).tolist()


def test_the_secondary_hosts_between_bodies_alike():
    contact = rows(3, (0, Y, {1: 0.4, 2: 0.6}))
    assert hosts(contact) == [0]
    assert hosts(contact, stiffness=np.array([0.9 * STIFFNESS_CONTRAST, 1.0, 1.0])) == [0]


@pytest.mark.parametrize("weights", [(0.4, 0.6), (1.1, -0.1), (0.0, 1.0)])
def test_the_nearest_node_of_a_much_softer_body_hosts(weights):
    contact = rows(4, (0, Y, dict(zip((1, 2), weights, strict=True))), (3, Y, {}))
    stiffness = np.array([1.1 * STIFFNESS_CONTRAST, 1.0, 1.0, 1.1 * STIFFNESS_CONTRAST])
    assert hosts(contact, stiffness=stiffness) == [1 + int(np.argmax(np.abs(weights))), 3]


def test_a_much_softer_node_that_is_held_does_not_host():
    contact = rows(3, (0, Y, {1: 0.4, 2: 0.6}))
    stiffness = np.array([1.1 * STIFFNESS_CONTRAST, 1.0, 1.0])
    assert hosts(contact, conditions(*clamped(2)), stiffness) == [0]
    assert hosts(contact, conditions(*clamped(0), *clamped(2)), stiffness) == [1]


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


def two_bodies(rng, d):
    """Supported inside, at the end of the zone or on one side of it."""
    secondary, primary, inner = np.arange(5), np.arange(5, 12), np.arange(12, 16)
    ends = [[], secondary[:1], primary[:2]][rng.integers(3)]
    contact = random_contact(rng, 16, secondary, primary, d)
    return random_conditions(rng, [*inner, *ends], d), contact


def three_bodies(rng, d):
    """The middle one is primary to the first and secondary to the last."""
    top, middle, bottom = np.arange(4), np.arange(4, 10), np.arange(10, 15)
    pairs = (top, middle), (middle[:4], bottom)
    contact = joined([random_contact(rng, 15, *pair, d) for pair in pairs])
    return random_conditions(rng, rng.choice(bottom, size=2, replace=False), d), contact


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("draw", [two_bodies, three_bodies])
def test_random_bodies(draw, d):
    for seed in range(150):
        given_, contact = draw(np.random.default_rng(seed), d)
        if well_separated(given_, contact):
            basis = check(given_, contact)  # measured 4e-15
            assert basis.kept.tolist() == list(range(len(contact.g)))


def test_a_ring_of_independent_rows_is_solved():
    """Both rows are fixed at their own nodes along x: each needs the unknown of the other."""
    contact = rows(2, (0, (0, -1), {1: 0.5}), (1, (0, 1), {0: 0.25}))
    basis = check(conditions((0, X, 0.0), (1, X, 0.1)), contact)
    assert basis.unknown.tolist() == [2, 3]
