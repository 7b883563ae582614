"""Uniform pressure passes between solids exactly, whatever their meshes are."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ngcontact import Contact, Elastic, Hooke, Problem, solve
from ngcontact.problem import MeshArrays, move_vertices
from tests.solids.meshes import boxes

LAWS = {"upper": Elastic(1.0, 0.3), "lower": Elastic(3.0, 0.2)}
SIDES = {"upper": ("upper_bottom", "lower_top", -1.0), "lower": ("lower_top", "upper_bottom", 1.0)}
TURN = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()


def blocks(upper, lower, width=1.0, turn=None):
    """A cube on a block, with so many divisions of their sides."""
    high, low = (width, width, 0.0), (0.0, 0.0, -1.0)
    return boxes(
        ("upper", (0, 0, 0), (1, 1, 1), (upper, upper, 2)),
        ("lower", low, high, (lower, lower, 2)),
        turn=turn,
    )


def pressed(mesh, secondary="upper", direction=True, rows="auto", laws=LAWS, turn=None):
    """The pressure 1 on the top, the bottom slides."""
    one, other, sign = SIDES[secondary]
    d = None
    if direction:
        d = (np.eye(3) if turn is None else turn) @ [0.0, 0.0, sign]
    return Problem(
        geometry=mesh,
        materials=laws,
        sliding="lower_bottom",
        traction={"upper_top": 1.0},
        contact=[Contact(one, other, direction=d, rows=rows)],
    )


@pytest.mark.parametrize("order", [1, 2])
def test_the_estimate_of_a_beam_on_two_blocks(order):
    """One side is the secondary of two pairs: what faces one block is not free beside the other."""
    lower = [(name, (x, 0, -1), (x + 1, 1, 0), (2, 2, 2)) for x, name in enumerate("bc")]
    problem = Problem(
        geometry=boxes(("a", (0, 0, 0), (2, 1, 1), (4, 2, 2)), *lower),
        materials={"a|b|c": Elastic(1.0, 0.0)},
        displacement={"b_bottom|c_bottom": (0, 0, 0)},
        sliding="a_left|a_front",
        traction={"a_top": 0.01},
        contact=[Contact("a_bottom", f"{x}_top", direction=(0, 0, -1)) for x in "bc"],
    )
    assert solve(problem, order=order).relative_error_estimate < 1e-12  # measured 2e-14


def stresses(mesh, stress):
    """Values (k, 3, 3) at points inside all elements."""
    points = mesh.MapToAllElements(ng.IntegrationRule(ng.TET, 2), ng.VOL)
    return np.asarray(stress(points)).reshape(-1, 3, 3)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("secondary", SIDES)
@pytest.mark.parametrize("counts", [(2, 2), (3, 2), (4, 1)])
@pytest.mark.parametrize("direction", [True, False])
def test_uniform_pressure(order, secondary, counts, direction):
    """Of turned bodies in any unit, and all that is told: constants are in the span of psi."""
    mesh, length = blocks(*counts, turn=TURN), {"upper": 1e-9, "lower": 1e9}[secondary]
    move_vertices(mesh, length * MeshArrays(mesh).vertices)
    solution = solve(pressed(mesh, secondary, direction, turn=TURN), order=order)
    name, _, sign = SIDES[secondary]
    expected = TURN @ np.diag([0.0, 0.0, -1.0]) @ TURN.T
    # Measured 2e-13.
    assert np.abs(stresses(mesh, solution.stress) - expected).max() < 1e-10
    assert np.abs(solution.pressure - 1.0).max() < 1e-10
    assert np.abs(solution.contact_force(0) / length**2 + sign * TURN[:, 2]).max() < 1e-10
    assert np.abs(solution.reactions["lower_bottom"] / length**2 - TURN[:, 2]).max() < 1e-10
    assert solution.steps == [0]
    assert solution.work["gap_searches"] == (counts != (2, 2))
    assert solution.relative_error_estimate < 1e-12  # round-off: measured 4e-14
    assert solution.transitions() == []
    assert solution.contact_area() == pytest.approx(length**2, rel=1e-12)
    field = solution.pressure_field()
    assert ng.Integrate((field - 1) ** 2 * ng.ds(name), mesh) < 1e-20 * length**2
    assert ng.Integrate(field * ng.ds, mesh) == pytest.approx(length**2, rel=1e-10)  # 0 elsewhere
    rows = solution.quantities()
    for key, unit in (
        ("force", 2),
        ("contact area", 2),
        ("mean pressure", 0),
        ("peak pressure", 0),
    ):
        assert rows[key].value == pytest.approx(length**unit, rel=1e-10)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("counts", [(2, 2), (4, 2), (5, 3), (2, 3)])
@pytest.mark.parametrize("direction", [True, False])
def test_uniform_pressure_beside_held_edges(order, counts, direction):
    """The secondary is held at two edges of its face, where it moves as it would without."""
    laws, u = {"upper": Elastic(10.0, 0.0), "lower": Elastic(30.0, 0.0)}, -1 / 30 - ng.z / 10
    problem = pressed(blocks(*counts), direction=direction, laws=laws)
    problem = replace(problem, displacement={"upper_left|upper_front": (None, 0, u)})
    solution = solve(problem, order=order)
    # Exact, as the psi add up to 1: measured 1e-12.
    assert np.abs(stresses(solution.mesh, solution.stress) - np.diag([0, 0, -1])).max() < 1e-10
    assert np.abs(solution.pressure - 1.0).max() < 1e-10
    assert np.abs(solution.reactions["lower_bottom"] - [0, 0, 1]).max() < 1e-10
    assert solution.contact_area() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("direction", [None, (0, 0, 1)])
def test_faces_behind_others_do_not_count(order, direction):
    """A primary of faces that lie behind its nearest one, and behind the body of the secondary."""
    names = ("base", "lowest", "low", "high", "highest")
    bodies = [
        (name, (0, 0, k), (1, 1, k + 1), (2 + k % 2, 2 + k % 2, 1)) for k, name in enumerate(names)
    ]
    every = "high_bottom|highest_bottom|lowest_bottom"
    problem = Problem(
        geometry=boxes(*bodies),
        materials=dict.fromkeys(names, LAWS["upper"]),
        sliding="base_bottom",
        traction={"highest_top": 1.0},
        contact=[
            Contact("low_top", every, direction=direction),
            Contact("base_top", "lowest_bottom"),
            Contact("lowest_top", "low_bottom"),
            Contact("high_top", "highest_bottom"),
        ],
    )
    solution = solve(problem, order=order)
    expected = np.diag([0.0, 0.0, -1.0])
    assert np.abs(stresses(solution.mesh, solution.stress) - expected).max() < 1e-10  # as above
    assert np.abs(solution.pressure - 1.0).max() < 1e-10


def rotated(C, R):
    """A law (6, 6) in other axes."""
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    full = np.zeros((3, 3, 3, 3))
    for a, (i, j) in enumerate(pairs):
        for b, (k, m) in enumerate(pairs):
            full[i, j, k, m] = full[j, i, k, m] = full[i, j, m, k] = full[j, i, m, k] = C[a, b]
    full = np.einsum("ai,bj,ck,dl,ijkl->abcd", R, R, R, R, full)
    return np.array([[full[(*one, *other)] for other in pairs] for one in pairs])


def test_rotated_cubic_law():
    cubic = np.diag([1.3 - 0.6] * 3 + [0.9] * 3)
    cubic[:3, :3] += 0.6
    C = rotated(cubic, TURN)
    mesh = blocks(3, 2)
    laws = LAWS | {"upper": Hooke((C + C.T) / 2)}
    solution = solve(pressed(mesh, laws=laws), order=2)
    assert np.abs(stresses(mesh, solution.stress) - np.diag([0.0, 0.0, -1.0])).max() < 1e-10


@pytest.mark.parametrize("secondary", SIDES)
def test_roles(secondary):
    """The covered side becomes secondary, of two the finer, whichever way the pair is given."""
    for counts, width, expected in (((2, 2), 1.5, "upper_bottom"), ((2, 4), 1.0, "lower_top")):
        problem = pressed(blocks(*counts, width=width), secondary)
        problem = replace(problem, contact=[replace(problem.contact[0], roles="auto")])
        solution = solve(problem, order=1)
        assert solution.discrete.lines[0].contact.secondary == expected
        assert np.abs(solution.contact_force()[2]) == pytest.approx(1.0, abs=1e-10)
