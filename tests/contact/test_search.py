"""Pairs that face each other are found, with their gaps and roles."""

import math

import ngsolve as ng
import pytest
from netgen.csg import unit_cube
from netgen.occ import Circle, Compound, Glue, OCCGeometry

from ngcontact import ContactWarning, Elastic, Problem, find_contacts
from ngcontact import geometries as gallery
from ngcontact.geometries.region import compound
from ngcontact.mesh import first_mesh
from tests.scenes import rectangle


def sides(found):
    return [(pair.secondary, pair.primary) for pair in found]


@pytest.mark.parametrize(
    ("geometry", "within", "expected"),
    [
        (gallery.blocks(), 1e-9, [("lower_contact", "upper_contact", 0.0)]),
        (gallery.disc_on_block(), 1e-9, [("disc_arc", "block_top", 0.0)]),
        (gallery.rings(interference=0.01), 0.02, [("inner_contact", "outer_contact", -0.01)]),
        (gallery.rings(interference=-0.01), 0.02, [("inner_contact", "outer_contact", 0.01)]),
        (gallery.ball_in_socket(clearance=0.05), 0.01, [("ball_arc", "socket_arc", 0.0)]),
        (gallery.sleeve_on_shaft(), 0.1, [("shaft_contact", "sleeve_contact", 0.0)]),
        (gallery.punch(), 0.1, [("foundation_contact", "punch_contact", 0.0)]),
        (
            gallery.ring_in_groove(),
            1e-3,
            [("groove", "ring_lower", 0.0), ("ring_upper", "plate_face", 0.0)],
        ),
    ],
)
def test_the_gallery_s_pairs(geometry, within, expected):
    """Not those that touch at a vertex alone, or look past each other."""
    found = find_contacts(geometry, within=within)
    assert {frozenset(pair[:2]) for pair in expected} == {frozenset(pair) for pair in sides(found)}
    for pair, (*_, gap) in zip(found, expected, strict=True):
        assert pair.least_gap == pytest.approx(gap, abs=1e-6)
        assert pair.gap is None  # measured where it is solved


@pytest.mark.parametrize("within", [0.6, 1.1, 10.0])
def test_nothing_is_found_through_a_body(within):
    """Behind a body, seen from its far side, another one is no partner, whatever `within` is."""
    bodies = rectangle("lower", (0, 1), (0.0, 0.5)), rectangle("upper", (0, 1), (0.5, 1.0))
    found = find_contacts(compound(*bodies), within=within)
    assert sides(found) == [("lower_top", "upper_bottom")]


def test_meshes_are_searched_as_drawings():
    geometry = gallery.disc_on_disc()
    mesh = first_mesh(Problem(geometry, {".*": Elastic(E=1.0, nu=0.3)}), 0.2)
    assert sides(find_contacts(mesh, within=1e-3)) == sides(find_contacts(geometry, within=1e-3))


def row_of_discs(gap, names=True):
    """Three discs of radius 1 beside each other on the x axis."""
    faces = []
    for k in range(3):
        face = Circle((k * (2 + gap), 0), 1).Face()
        face.name, face.edges.name = f"disc{k}", f"arc{k}" if names else "arc"
        faces.append(face)
    return OCCGeometry(Compound(faces), dim=2)


def test_gaps_between_vertices_are_followed():
    """Between the points looked at, to the error of the curved mesh."""
    found = find_contacts(row_of_discs(1e-3), within=2e-3)
    assert [set(pair) for pair in sides(found)] == [{"arc0", "arc1"}, {"arc1", "arc2"}]
    for k, pair in enumerate(found):
        assert pair.least_gap == pytest.approx(1e-3, abs=1e-5)
        assert pair.place[0] == pytest.approx(k * 2.001 + 1, abs=2e-3)


@pytest.mark.parametrize(
    ("within", "error"),
    [(0.0, ValueError), (-1.0, ValueError), (math.nan, ValueError), ("near", TypeError)],
)
def test_lengths_that_are_refused(within, error, no_work):
    with pytest.raises(error, match="within"):
        find_contacts(gallery.blocks(), within=within)


def test_nothing_near_enough_is_a_warning():
    with pytest.warns(ContactWarning, match=r'within 1e-05; "arc\d" is 0.001.* apart from "arc\d"'):
        assert find_contacts(row_of_discs(1e-3), within=1e-5) == []
    one = rectangle("one", (0, 1), (0, 1), "rim")
    other = rectangle("other", (1, 2), (0, 1), ("edge", "edge", "edge", "side"))
    glued = OCCGeometry(Glue([one, other]), dim=2)
    with pytest.warns(ContactWarning, match="join them by Compound, not Glue"):
        assert find_contacts(glued, within=1.0) == []


def test_sides_without_names_of_their_own_are_refused():
    with pytest.raises(ValueError, match='"arc" and "arc" of two bodies face each other near'):
        find_contacts(row_of_discs(1e-3, names=False), within=1e-2)
    with pytest.raises(TypeError, match="geometry is"):
        find_contacts("blocks", within=1e-2)
    with pytest.raises(ValueError, match="find_contacts is not available for solids"):
        find_contacts(ng.Mesh(unit_cube.GenerateMesh(maxh=1, parallel_meshing=False)), within=1e-2)
