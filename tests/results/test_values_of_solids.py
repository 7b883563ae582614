"""Values at points of solids: exact fields, curved faces, bodies that share a point, refusals."""

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import cube_on_block, shells

# Identities of affine fields, relative: measured 1e-13 and less where all unknowns are prescribed.
# At order 3 some are not, and quadrature of the stiffness of curved elements leaves 2e-7: its
# degree is 4, constant stress there needs 6.
EXACT = {1: 1e-11, 2: 1e-11, 3: 1e-6}
STRAIN = np.array([[2e-3, 1e-3, 0], [-4e-4, -3e-3, 5e-4], [3e-4, 0, 1e-3]])
LAM, MU = 200 * 0.3 / (1.3 * 0.4), 100 / 1.3
STRESS = LAM * np.trace(STRAIN) * np.eye(3) + MU * (STRAIN + STRAIN.T)


def stretched_shells(order):
    """An octant of two shells, all of whose boundary moves by an affine field, u_h itself."""
    affine = tuple(g[0] * ng.x + g[1] * ng.y + g[2] * ng.z for g in STRAIN.tolist())
    names = ("hole", "inner_contact", "outer_contact", "rim", "cut_x", "cut_y", "cut_z")
    law = dict.fromkeys(("inner", "outer"), Elastic(E=200.0, nu=0.3))
    problem = Problem(
        geometry=shells(interference=0.01), materials=law, displacement=dict.fromkeys(names, affine)
    )
    return solve(problem, maxh=0.6, order=order)


def pressed_cube():
    return Problem(
        geometry=cube_on_block(width=1.0),
        materials={"cube": Elastic(E=1.0, nu=0.3), "block": Elastic(E=3.0, nu=0.2)},
        displacement={"block_bottom": (0, 0, 0)},
        traction={"cube_top": 0.1},
        contact=[Contact("cube_bottom", "block_top", direction=(0, 0, -1))],
    )


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
    exact = points @ STRAIN.T
    assert np.abs(values.displacement - exact).max() < EXACT[order] * np.abs(exact).max()
    assert np.abs(values.stress - STRESS).max() < 10 * EXACT[order] * np.abs(STRESS).max()


def test_invariants_are_those_of_the_tensor():
    values = stretched_shells(2).at((0.2, 0.7, 0.1))
    three = np.sort(np.linalg.eigvalsh(STRESS))[::-1]
    np.testing.assert_allclose(values.principal_stresses, three, rtol=1e-9)
    deviator = STRESS - np.trace(STRESS) / 3 * np.eye(3)
    assert values.von_mises == pytest.approx(np.sqrt(1.5 * (deviator**2).sum()), rel=1e-9)
    assert values.displacement.shape == (3,)
    with pytest.raises(ValueError, match="no stress out of a plane"):
        _ = values.out_of_plane_stress


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
    assert "0.1)" in solution._repr_html_()


def test_refusals_name_the_first_point():
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
