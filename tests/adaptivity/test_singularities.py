"""Where solutions are not smooth: ends of contact, changes of condition, corners that point in."""

import numpy as np
import pytest
from netgen.occ import Axis, OCCGeometry, Rectangle, Z

from drivers.reference import cases
from ngcontact import Elastic, Problem, adapt
from ngcontact.adaptivity import corners, ends_of_contact
from ngcontact.fem import boundary_trace
from ngcontact.geometries import rings
from ngcontact.mesh import first_mesh

SOFT = Elastic(E=1.0, nu=0.3)


def ell(angle):
    """An L with the corner that points inwards at the origin, named by nothing but its left."""
    shape = Rectangle(2, 2).Face().Move((-1, -1, 0)) - Rectangle(1, 1).Face()
    shape.edges.name = "free"
    shape.edges.Min((1, 0, 0)).name = "left"
    shape.faces.name = "body"
    return OCCGeometry(shape.Rotate(Axis((0, 0, 0), Z), angle), dim=2)


def found(problem, maxh=0.5):
    """Corners, sorted."""
    places = corners(problem, boundary_trace(first_mesh(problem, maxh), 1)).places
    return places[np.lexsort(places.round(9).T)]


@pytest.mark.parametrize("angle", [0, 30])
def test_conditions_that_meet_and_corners_that_point_inwards(angle):
    problem = Problem(geometry=ell(angle), materials={"body": SOFT}, displacement={"left": (0, 0)})
    a = np.deg2rad(angle)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    expected = np.array([(-1, -1), (-1, 1), (0, 0)]) @ turn.T
    assert found(problem) == pytest.approx(expected[np.lexsort(expected.round(9).T)], abs=1e-9)


def test_a_load_that_begins_counts_and_names_do_not():
    block = cases.partly_opening_block()
    # Of the upper block: ends of the load, of the guide, of the contact. Of the lower one: those of
    # the support, the guide, the contact.
    expected = {(0, 1), (1, 1), (0, 0), (2, 0), (0, -1), (2, -1)}
    assert {tuple(place) for place in found(block).round(9)} == expected
    # A hole of chords is no corner, nor is the seam of a circle.
    ring = Problem(geometry=rings(), materials={"inner|outer": SOFT}, displacement={"rim": (0, 0)})
    assert len(found(ring)) == 0


def test_ends_of_contact_lie_on_both_bodies():
    *_, disc = adapt(cases.pressed_disc(), order=2, max_dofs=3000)
    ends = ends_of_contact(disc.pairs)
    [(x, y)] = disc.transitions()
    assert ends.places[:, 0] == pytest.approx([x, x], rel=1e-9)
    # The gap between two contact points, of which it is a mean, is a square of the distance.
    assert sorted(ends.places[:, 1]) == pytest.approx([0, y], abs=0.03 * y)  # measured 0.006
    assert (ends.powers == 1.5).all()
    extent = np.linalg.norm(np.ptp(disc.pairs[0].line.position, axis=0))
    assert ends.extents == pytest.approx(extent)
