"""Values at points: exact fields, curved elements, bodies that share a point, refusals; solids."""

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Elastic, Problem, solve
from ngcontact.geometries import disc, shells
from tests.scenes import pressed_cube

EXACT = 1e-10  # identities of affine and quadratic fields; measured 1e-13 and less
STRAIN = np.array([[2e-3, 1e-3], [-4e-4, -3e-3]])


def stretched_disc(order, radius=1.0, element="isoparametric"):
    """A quarter disc whose whole boundary moves by an affine field, which u_h is then itself."""
    affine = tuple(g[0] * ng.x + g[1] * ng.y for g in STRAIN.tolist())
    sides = dict.fromkeys(("axis", "top", "arc"), affine)
    law = {"disc": Elastic(E=200.0, nu=0.3)}
    problem = Problem(geometry=disc(radius), materials=law, displacement=sides)
    return solve(problem, maxh=0.6 * radius, order=order, element=element)


def affine_stress(strain):
    """Lambda tr e + 2 mu e, (3, 3), in plane strain or of a solid."""
    e = np.zeros((3, 3))
    e[: len(strain), : len(strain)] = (strain + strain.T) / 2
    return 200 * 0.3 / (1.3 * 0.4) * np.trace(e) * np.eye(3) + 200 / 1.3 * e


# Identities of affine fields, relative: measured 1e-13 and less where all unknowns are prescribed.
# At order 3 some are not, and quadrature of the stiffness of curved elements leaves 2e-7: its
# degree is 4, constant stress there needs 6.
EXACT_OF_SOLIDS = {1: 1e-11, 2: 1e-11, 3: 1e-6}
STRAIN_OF_SOLIDS = np.array([[2e-3, 1e-3, 0], [-4e-4, -3e-3, 5e-4], [3e-4, 0, 1e-3]])


def stretched_shells(order):
    """An octant of two shells, all of whose boundary moves by an affine field, u_h itself."""
    affine = tuple(g[0] * ng.x + g[1] * ng.y + g[2] * ng.z for g in STRAIN_OF_SOLIDS.tolist())
    names = ("hole", "inner_contact", "outer_contact", "rim", "cut_x", "cut_y", "cut_z")
    law = dict.fromkeys(("inner", "outer"), Elastic(E=200.0, nu=0.3))
    problem = Problem(
        geometry=shells(interference=0.01), materials=law, displacement=dict.fromkeys(names, affine)
    )
    return solve(problem, maxh=0.6, order=order)


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
    stress = affine_stress(STRAIN)
    plane = np.broadcast_to(stress[:2, :2], (4, 101, 2, 2))
    np.testing.assert_allclose(values.stress, plane, rtol=1e-9)
    np.testing.assert_allclose(values.out_of_plane_stress, stress[2, 2], rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_points_beyond_the_arc_by_a_tenth_digit_belong_to_the_body(order):
    """Coordinates of ten digits lie beyond an arc; those of six are another place."""
    turn = -np.linspace(0.05, 1.5, 31)
    arc = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    for beyond, name in ((1e-10, "disc"), (1e-6, "")):
        values = stretched_disc(order).at((0, 1) + (1 + beyond) * arc, outside="nan")
        assert set(values.body) == {name}


@pytest.mark.parametrize("order", [1, 2, 3])
def test_points_between_facet_and_sphere_belong_to_the_body(order):
    solution = stretched_shells(order)
    rng = np.random.default_rng(1)
    direction = np.abs(rng.normal(size=(100, 3)))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = np.array([1.5, 1.5 - 1e-6, 1.499, 1.45, 1.2, 0.9, 0.55])[:, None, None]
    points = radius * direction
    volume = ng.Integrate(ng.CF(1.0), solution.mesh, definedon=solution.mesh.Materials("outer"))
    exact = np.pi / 6 * (1.5**3 - 0.99**3)
    assert order > 1 or volume < 0.97 * exact  # plane facets miss something
    values = solution.at(points)
    assert set(values.body[:5].ravel()) == {"outer"}
    assert set(values.body[5:].ravel()) == {"inner"}
    exact = points @ STRAIN_OF_SOLIDS.T
    assert np.abs(values.displacement - exact).max() < EXACT_OF_SOLIDS[order] * np.abs(exact).max()
    stress = affine_stress(STRAIN_OF_SOLIDS)
    assert np.abs(values.stress - stress).max() < 10 * EXACT_OF_SOLIDS[order] * np.abs(stress).max()


@pytest.mark.parametrize("dim", [2, 3])
def test_invariants_are_those_of_the_tensor(dim):
    point, strain = ((0.2, 0.7), STRAIN) if dim == 2 else ((0.2, 0.7, 0.1), STRAIN_OF_SOLIDS)
    values, tensor = (
        (stretched_disc if dim == 2 else stretched_shells)(2).at(point),
        affine_stress(strain),
    )
    three = np.sort(np.linalg.eigvalsh(tensor))[::-1]
    np.testing.assert_allclose(values.principal_stresses, three, rtol=1e-9)
    deviator = tensor - np.trace(tensor) / 3 * np.eye(3)
    assert values.von_mises == pytest.approx(np.sqrt(1.5 * (deviator**2).sum()), rel=1e-9)
    assert values.displacement.shape == (dim,)
    if dim == 3:
        with pytest.raises(ValueError, match="no stress out of a plane"):
            _ = values.out_of_plane_stress


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


def test_a_line_through_two_bodies_and_its_table():
    """A column under pressure p: stress -p along z in both bodies at most."""
    solution = solve(pressed_cube(), maxh=0.5, order=2)
    line = solution.along((0.1, 0.1, -0.9), (0.1, 0.1, 0.9), 10)
    assert list(line.body) == ["block"] * 5 + ["cube"] * 5
    np.testing.assert_allclose(line.distance, np.linspace(0, 1.8, 10), rtol=1e-12)
    # Near the free end St. Venant: measured 2e-3 of the pressure.
    assert line.stress[-1, 2, 2] == pytest.approx(-0.1, rel=0.02)
    table = line.columns()
    assert list(table)[:7] == ["x", "y", "z", "body", "ux", "uy", "uz"]
    assert {len(column) for column in table.values()} == {10}
    np.testing.assert_array_equal(table["szz"], line.stress[:, 2, 2])
    np.testing.assert_array_equal(table["syz"], line.stress[:, 1, 2])
    row = solution.record()
    assert row["contact_0_force_z"] == pytest.approx(0.1, rel=1e-9)
    assert row["reaction_block_bottom_z"] == pytest.approx(0.1, rel=1e-9)
    assert "force 0.1" in str(solution)


def test_refusals_of_solids_name_the_first_point():
    solution = solve(pressed_cube(), maxh=0.7, order=1)
    for points, message in (
        ((0.1, 0.1, 2.0), r"1 of 1 points lie outside of all bodies.*\(0.1, 0.1, 2\)"),
        ((0.1, 0.2, 0.0), r"\(0.1, 0.2, 0\) lies in several bodies, \['block', 'cube'\]"),
        ((0.1, 0.2), r"shape \(2,\): give an array \(k, 3\) of x, y and z"),
    ):
        with pytest.raises(ValueError, match=message):
            solution.at(points)
    below = solution.at((0.1, 0.2, 0.0), body="block")
    assert below.body == "block"
    values = solution.at([(0, 0, 0.5), (0, 0, 2)], outside="nan")
    np.testing.assert_array_equal(np.isnan(values.von_mises), [False, True])
    assert np.isnan(values.principal_stresses[1]).all()
    assert solution.at(np.zeros((0, 3))).stress.shape == (0, 3, 3)
