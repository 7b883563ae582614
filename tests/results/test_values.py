"""Values at points: exact fields, curved elements, bodies that share a point, refusals."""

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Elastic, Problem, solve
from ngcontact.geometries import disc

EXACT = 1e-10  # identities of affine and quadratic fields; measured 1e-13 and less
STRAIN = np.array([[2e-3, 1e-3], [-4e-4, -3e-3]])


def stretched_disc(order, radius=1.0, element="isoparametric"):
    """A quarter disc whose whole boundary moves by an affine field, which u_h is then itself."""
    affine = tuple(g[0] * ng.x + g[1] * ng.y for g in STRAIN.tolist())
    sides = dict.fromkeys(("axis", "top", "arc"), affine)
    law = {"disc": Elastic(E=200.0, nu=0.3)}
    problem = Problem(geometry=disc(radius), materials=law, displacement=sides)
    return solve(problem, maxh=0.6 * radius, order=order, element=element)


def affine_stress():
    """Plane strain: lambda tr e + 2 mu e."""
    strain = (STRAIN + STRAIN.T) / 2
    lam, mu = 200 * 0.3 / (1.3 * 0.4), 100 / 1.3
    return lam * np.trace(strain) * np.eye(2) + 2 * mu * strain, lam * np.trace(strain)


@pytest.mark.parametrize("radius", [1.0, 1e6])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_points_between_chord_and_arc_belong_to_the_body(order, radius):
    solution = stretched_disc(order, radius)
    turn = -np.linspace(0, np.pi / 2, 101)  # the quarter below the middle, at (0, R)
    depth = np.array([0.0, 1e-6, 1e-3, 3e-2])[:, None]  # sagitta of a chord: up to 0.045 R
    points = radius * np.stack(
        [(1 - depth) * np.cos(turn), 1 + (1 - depth) * np.sin(turn)], axis=-1
    )
    mesh_area = ng.Integrate(ng.CF(1.0), solution.mesh) / radius**2
    assert order > 1 or mesh_area < np.pi / 4 - 0.01  # the chords miss something
    values = solution.at(points)
    assert set(values.body.ravel()) == {"disc"}
    np.testing.assert_allclose(values.displacement, points @ STRAIN.T, atol=EXACT * radius)
    stress, normal = affine_stress()
    np.testing.assert_allclose(values.stress, np.broadcast_to(stress, (4, 101, 2, 2)), rtol=1e-9)
    np.testing.assert_allclose(values.out_of_plane_stress, normal, rtol=1e-9)


def test_invariants_are_those_of_the_tensor():
    values = stretched_disc(2).at((0.2, 0.7))
    stress, normal = affine_stress()
    tensor = np.zeros((3, 3))
    tensor[:2, :2], tensor[2, 2] = stress, normal
    three = np.sort(np.linalg.eigvalsh(tensor))[::-1]
    np.testing.assert_allclose(values.principal_stresses, three, rtol=1e-9)
    deviator = tensor - np.trace(tensor) / 3 * np.eye(3)
    assert values.von_mises == pytest.approx(np.sqrt(1.5 * (deviator**2).sum()), rel=1e-9)
    assert values.displacement.shape == (2,)


def test_fields_of_two_bodies_that_share_a_line():
    """A pressure that is linear along the line: the solution is quadratic, in V_h of order 2."""
    case = cases.pressure_patch(p1=0.5)
    solution = solve(case.problem, maxh=0.4, order=2)
    x = np.linspace(-0.9, 0.9, 13)
    scale = 1.5  # of the pressure
    for body, sign in (("upper", 1), ("lower", -1)):
        points = np.column_stack([x, sign * 0.3 * np.abs(np.sin(9 * x))])  # some on the line
        values = solution.at(points, body=body)
        inside = solution.mesh(0.0, sign * 0.2)  # NGSolve's own search, for the exact fields
        assert inside.nr >= 0
        for k in np.flatnonzero(np.abs(points[:, 1]) > 1e-3):
            at = solution.mesh(*points[k])
            exact = np.array(case.exact.stress[body](at)).reshape(2, 2)
            np.testing.assert_allclose(values.stress[k], exact, atol=1e-9 * scale)
        line = solution.along((-0.9, 0), (0.9, 0), 19, body=body)
        pressure = case.exact.pressure(line.points[:, 0])
        np.testing.assert_allclose(-line.stress[:, 1, 1], pressure, atol=1e-9 * scale)
    np.testing.assert_allclose(line.distance, np.linspace(0, 1.8, 19), rtol=1e-12)
    with pytest.raises(ValueError, match=r"several bodies, \['lower', 'upper'\]: .*body=\"lower\""):
        solution.at((0.1, 0.0))


def two_blocks():
    return cases.touching_blocks({"bottom": (0, 0), "top": (0, -0.01)})


def test_refusals_name_the_first_point():
    solution = solve(two_blocks(), maxh=1.0)
    inside = (0.3, 0.4)
    for wrong, message in (
        ({"points": [inside, (7, 8)]}, r"1 of 2 points .* all bodies.*\(7, 8\).*outside=\"nan\""),
        ({"points": inside, "body": "lower"}, r'body "lower".*\(0.3, 0.4\), but in "upper"'),
        ({"points": inside, "body": "uper"}, 'body "uper" selects no region; did you mean "upper"'),
        ({"points": (0.1, np.nan)}, "finite"),
        ({"points": [1.0, 2.0, 3.0]}, r"shape \(3,\)"),
        ({"points": inside, "outside": "zero"}, "outside='zero'"),
    ):
        with pytest.raises(ValueError, match=message):
            solution.at(**wrong)
    with pytest.raises(TypeError, match="give an array"):
        solution.at("left")
    with pytest.raises(ValueError, match="at least 2"):
        solution.along((0, 0), (0, 1), 1)
    assert solution.at(np.zeros((0, 2))).stress.shape == (0, 2, 2)


def test_a_table_of_columns():
    values = solve(two_blocks(), maxh=1.0).along((0.1, 0.1), (0.2, 0.3), 5)
    table = values.columns()
    assert {len(column) for column in table.values()} == {5}
    np.testing.assert_array_equal(table["sxy"], values.stress[:, 0, 1])
    np.testing.assert_array_equal(table["principal_1"], values.principal_stresses[:, 0])
