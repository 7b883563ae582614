"""Rows where nodes do not face nodes, against exact solutions that the elements contain."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from netgen.occ import OCCGeometry

from drivers.reference import cases
from drivers.reference.straight import relative_energy_error
from ngcontact import Contact, solve
from ngcontact.contact.dual import _across_turns
from ngcontact.geometries import blocks
from tests.given_meshes import two_blocks
from tests.scenes import divided, pressed

EXACT = 1e-10  # round-off times the condition of small meshes; measured below 2e-12


def spread(count, seed):
    """Nodes of so many segments on -1 < x < 1, the inner ones moved by up to a third."""
    x = np.linspace(-1, 1, count + 1)
    x[1:-1] += np.random.default_rng(seed).uniform(-0.33, 0.33, count - 1) * 2 / count
    return x


FIVE, SEVEN = np.linspace(-1, 1, 5), np.linspace(-1, 1, 7)
GIVEN = {  # nodes of the upper and of the lower line
    "any": (spread(5, 1), spread(17, 2)),
    "only the lower one refined": (FIVE, np.linspace(-1, 1, 9)),
    "refined in one place": (FIVE, np.insert(FIVE, 2, -0.25)),
    "nearly the same": (SEVEN, SEVEN + 1e-6 * (spread(6, 3) ** 2 - 1)),
}
DIVIDED = {f"{m}:{n}": (m, n) for m, n in ((4, 6), (5, 37), (10, 73), (4, 8))}


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("lines", [*DIVIDED, *GIVEN])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.study(
    witness=[
        "1-4:8-True",
        "1-4:6-False",
        "1-4:8-False",
        "1-any-True",
        "1-refined in one place-True",
    ]
)
def test_pressures_of_degree_p_minus_1_are_exact(order, lines, swap):
    """Whichever side has more nodes, on meshes that are made and on given ones."""
    case = cases.pressure_patch(p1=0.0 if order == 1 else 0.5)
    if lines in DIVIDED:
        solution = solve(pressed(case, DIVIDED[lines], swap), maxh=0.5, order=order)
    else:
        [pair] = case.problem.contact
        pair = pair.swapped() if swap else pair
        problem = replace(case.problem, geometry=two_blocks(*GIVEN[lines]), contact=[pair])
        solution = solve(problem, order=order)
    assert relative_energy_error(solution, case.exact) < EXACT
    pressure = case.exact.pressure(solution.points[:, 0])
    np.testing.assert_allclose(solution.pressure, pressure, rtol=EXACT)
    assert abs(np.linalg.norm(solution.contact_force()) - 2.0) < 2 * EXACT  # p = 1 + slope x


@pytest.mark.parametrize("rows", ["auto", "dual"])
def test_matched_meshes_take_the_rows_of_the_paper_unless_asked(rows):
    case = cases.pressure_patch(p1=0.5)
    problem = replace(
        case.problem, contact=[replace(pair, rows=rows) for pair in case.problem.contact]
    )
    solution = solve(problem, maxh=0.5, order=3)
    [pair] = solution.pairs
    assert pair.line.means.all() == (rows == "dual")
    assert relative_energy_error(solution, case.exact) < EXACT


@pytest.mark.parametrize("order", [1, 2, 3])
def test_rings_converge_at_the_best_rates(order):
    """Curved lines, segments 2:3. Theory: rates 1, 2, 3 in h; measured .91, 2.07, 3.2."""
    errors = []
    for n in (8, 16):
        case = cases.ring_in_ring()
        solution = solve(pressed(case, (n, 3 * n // 2), False), maxh=1.6 / n, order=order)
        errors.append(relative_energy_error(solution, case.exact))
    assert np.log2(errors[0] / errors[1]) > {1: 0.88, 2: 1.85, 3: 2.6}[order]


def parts(counts):
    """Two blocks whose contact lines are made of the edges a, b, c and d, e, f."""
    line = ((-1.0, 0.0), (-0.4, 0.0), (0.3, 0.0), (1.0, 0.0))
    shape = blocks(line=line).shape
    for side, names in (("upper_contact", "abc"), ("lower_contact", "def")):
        edges = sorted((e for e in shape.edges if e.name == side), key=lambda e: e.center.x)
        for edge, name in zip(edges, names, strict=True):
            edge.name = name
    return divided(OCCGeometry(shape, dim=2), counts)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("matched", [True, False])
@pytest.mark.parametrize("change", [{}, {"bilateral": True}, {"gap": 0.0}])
@pytest.mark.study(witness=["change0-True-2", "change1-False-1", "change2-False-3"])
def test_overlapping_pairs_of_other_primaries_are_one(change, matched, order):
    """Weights of points that two pairs share count once; measured: 2e-11 and less."""
    case = cases.pressure_patch()
    geometry = parts(dict.fromkeys("abcdef", 3) | ({} if matched else {"a": 2, "b": 4, "d": 4}))
    whole, part = Contact("a|b|c", "d|e|f"), Contact("b", "e", **change)
    for pairs in ((whole, part), (part, whole)):
        problem = replace(case.problem, geometry=geometry, contact=pairs)
        solution = solve(problem, maxh=0.5, order=order)
        np.testing.assert_allclose(solution.pressure, 1.0, rtol=1e-10)
        forces = [solution.contact_force(pair) for pair in range(2)]
        np.testing.assert_allclose(sum(forces), [0.0, 2.0], atol=2e-10)
        assert all(len(list(solution.quantities(pair))) for pair in range(2))


@pytest.mark.parametrize("order", [1, 2])
def test_sides_along_the_direction_carry_nothing(order):
    """Where other segments of the secondary face: their rows are those without the sides."""
    case = cases.pressure_patch(p1=0.0)
    mesh, forces = two_blocks(FIVE, 1.2 * SEVEN), []
    for secondary in ("upper_contact", "upper_contact|upper_right"):
        pair = Contact(secondary, "lower_contact", direction=(0, -1))
        loads = {"displacement": {"bottom": (0, 0), "top": (0, -0.1)}, "traction": {}}
        problem = replace(case.problem, geometry=mesh, contact=[pair], sliding=None, **loads)
        forces.append(solve(problem, order=order).force)
    np.testing.assert_allclose(forces[1], forces[0], rtol=EXACT)


def test_few_nodes_of_a_curved_face_turn_no_direction_away():
    """Three nodes resist three motions of six: what is left of d across the rest is round-off."""
    x, y = np.random.default_rng(1).uniform(-0.5, 0.5, (2, 3))
    position = np.column_stack([x, y, (x**2 + 2 * y**2) / 2])
    d = np.column_stack([x, 2 * y, -np.ones(3)])
    d /= np.linalg.norm(d, axis=1)[:, None]
    few = SimpleNamespace(position=position, direction=d)
    assert (_across_turns(few, position, d) * d).sum(axis=1).min() > 0.5
