"""Contact points: which of them face the other body."""

import math

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference.cases import LINE
from ngcontact import Contact
from ngcontact.contact.dual import contact_line
from ngcontact.fem import boundary_trace
from ngcontact.geometries import blocks


def trace_of(geometry, order):
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=0.5))
    mesh.Curve(order)
    return boundary_trace(mesh, order)


def polygonal(order, direction):
    trace = trace_of(blocks(line=LINE), order)
    return trace, contact_line(trace, Contact("upper_contact", "lower_contact", direction))


def test_steep_sides_do_not_face_a_fixed_direction():
    """A direction almost along the middle side: only the outer sides face it."""
    (x, y), (right, top) = LINE[1:3]
    slope = math.atan2(top - y, right - x)
    d = (math.cos(slope - 0.1), math.sin(slope - 0.1))  # n.d = sin 0.1 > 0 on the middle side
    trace, line = polygonal(1, direction=d)
    assert len(np.unique(line.rows)) == len(line.segments) + 1
    d = (math.cos(slope + 0.1), math.sin(slope + 0.1))  # -sin 0.1 there
    trace, line = polygonal(2, direction=d)
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
