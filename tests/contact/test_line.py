"""Contact points: corners, and which points carry a row."""

import math

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference.cases import LINE
from ngcontact import Contact
from ngcontact.contact.dual import contact_line
from ngcontact.fem import boundary_trace
from ngcontact.geometries import blocks

ORDERS = [1, 2, 3, 4]
SIDES = np.diff(np.array(LINE), axis=0)
LENGTHS = np.linalg.norm(SIDES, axis=1)
DOWNWARD = np.column_stack([SIDES[:, 1], -SIDES[:, 0]]) / LENGTHS[:, None]


def trace_of(geometry, order):
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=0.5))
    mesh.Curve(order)
    return boundary_trace(mesh, order)


def points_are_consistent(line, trace):
    """What holds of every line: sizes, rows, nodes, positions."""
    m = len(line.node)
    for name in ("gap", "weight", "partner", "partner_s"):
        assert getattr(line, name).shape == (m,)
    for name in ("position", "direction"):
        assert getattr(line, name).shape == (m, 2)
    assert line.rows.shape == (len(line.segments), trace.order + 1)
    assert set(line.rows.ravel()) - {-1} == set(range(m))
    here = line.rows >= 0
    assert (line.node[line.rows[here]] == trace.nodes[line.segments][here]).all()
    np.testing.assert_allclose(np.linalg.norm(line.direction, axis=1), 1, atol=1e-15)
    assert (line.weight > 0).all()
    assert (line.faces == here.all(axis=1)).all()


def polygonal(order, direction=None):
    trace = trace_of(blocks(line=LINE), order)
    return trace, contact_line(trace, Contact("upper_contact", "lower_contact", direction))


def at_corner(line, vertex):
    return np.flatnonzero(np.linalg.norm(line.position - vertex, axis=1) < 1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_bounded_zone_has_two_points_at_corners(order):
    trace, line = polygonal(order)
    points_are_consistent(line, trace)
    assert len(line.node) == order * len(line.segments) + 3
    for k in (1, 2):
        points = at_corner(line, LINE[k])
        assert len(set(line.node[points])) == 1
        sides = line.direction[points] @ DOWNWARD.T
        assert sorted(sides.argmax(axis=1)) == [k - 1, k]
        np.testing.assert_allclose(sides.max(axis=1), 1, atol=1e-15)
    # Every segment's points have the normal of its side.
    middle = line.position[line.rows].mean(axis=1)[:, 0]
    side = np.searchsorted([LINE[1][0], LINE[2][0]], middle)
    normals = np.repeat(DOWNWARD[side][:, None], order + 1, axis=1)
    np.testing.assert_allclose(line.direction[line.rows], normals, atol=1e-15)


def test_steep_sides_do_not_face_a_fixed_direction():
    """A direction almost along the middle side: only the outer sides face it."""
    slope = math.atan2(SIDES[1, 1], SIDES[1, 0])
    d = (math.cos(slope - 0.1), math.sin(slope - 0.1))  # n.d = sin 0.1 > 0 on the middle side
    trace, line = polygonal(1, direction=d)
    assert len(np.unique(line.rows)) == len(line.segments) + 1
    d = (math.cos(slope + 0.1), math.sin(slope + 0.1))  # -sin 0.1 there
    trace, line = polygonal(2, direction=d)
    points_are_consistent(line, trace)
    middle = trace.curve[line.segments].mean(axis=1)[:, 0]
    inner = (middle > LINE[1][0]) & (middle < LINE[2][0])
    facing = trace.normal(line.segments, np.full(len(inner), 0.5)) @ d > 0
    assert (facing == ~inner).all()
    assert (line.rows[inner] == -1).all()
    assert not line.faces[inner].any()


@pytest.mark.parametrize(
    "contact",
    [
        Contact("upper_contact", "lower_contact", (0, 1)),  # from primary to secondary
        Contact("upper_contact", "lower_contact", (1, 0)),  # along the line
        Contact("upper_contact", "bottom", (0, -1)),  # the primary faces away
        Contact("upper_contact", "bottom"),
        Contact("upper_left", "lower_contact"),  # rays that miss it
    ],
)
def test_pairs_that_do_not_face_are_refused(contact):
    trace = trace_of(blocks(), 1)
    with pytest.raises(ValueError, match=r"no point of the secondary .* faces the primary"):
        contact_line(trace, contact)
