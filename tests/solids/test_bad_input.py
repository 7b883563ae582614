"""What solids refuse: the value, and what would be right."""

import re
import warnings
from dataclasses import replace

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import pytest
from netgen.meshing import Element2D, Mesh, MeshPoint, Pnt
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh

from drivers.reference import cases
from ngcontact import Contact, Elastic, Hooke, Problem, solve
from ngcontact.problem import MeshArrays, move_vertices
from tests.solids.meshes import boxes, named
from tests.solids.test_patch import blocks, pressed

SOFT = Elastic(1.0, 0.3)
BOX = {"a": SOFT}


def box(name="a"):
    return named(name, occ.Box((0, 0, 0), (1, 1, 1)))


def mixed():
    face = occ.WorkPlane().MoveTo(3, 0).Rectangle(1, 1).Face()
    return occ.OCCGeometry(occ.Compound([box(), face]))


def hollow():
    """The faces of a cube without its volume."""
    return occ.OCCGeometry(occ.Compound(list(box().faces)))


def glued():
    return occ.OCCGeometry(occ.Glue([box(), occ.Box((0, 0, 1), (1, 1, 2))]))


def gap_of_two(x, y):
    return 0 * x


OBSTACLE = {"secondary": "a_bottom", "direction": (0, 0, -1), "gap": 0.0}


@pytest.mark.parametrize(
    ("data", "error", "words"),
    [
        ({"geometry": mixed}, ValueError, "bound none of them: bodies are either solids or faces"),
        ({"geometry": hollow}, ValueError, "has no solids, and its faces lie in no plane"),
        ({"geometry": glued}, ValueError, "bounds two solids.*Compound, not Glue"),
        ({"displacement": {"a_bottom": (0, 0)}}, ValueError, "length 2: give a triple"),
        ({"traction": {"a_side": (0, 1)}}, ValueError, "length 2: give a triple"),
        ({"force": {"a": ng.CF((0, 1))}}, ValueError, r"dims \(2,\): give a 3-vector"),
        ({"model": "plane stress"}, ValueError, "is for plane bodies: leave it out with solids"),
        ({"materials": {"a": Hooke(np.eye(3))}}, ValueError, r"\(3, 3\).*needs a 6x6"),
        ({"materials": {"a": Hooke(np.eye(4))}}, ValueError, r"\(4, 4\).*needs a 6x6"),
        ({"contact": [Contact(**OBSTACLE | {"direction": (0, -1)})]}, ValueError, "give a triple"),
    ],
)
def test_problems_that_are_refused(data, error, words):
    given = {"geometry": lambda: occ.OCCGeometry(box()), "materials": BOX} | data
    with pytest.raises(error, match=words):
        Problem(**given | {"geometry": given["geometry"]()})


def mirrored():
    mesh = blocks(1, 1)
    move_vertices(mesh, MeshArrays(mesh).vertices * [1, 1, -1])
    return mesh


def curved_without_cad():
    mesh = MakeStructured3DMesh(hexes=False, nx=1)
    mesh.Curve(2)
    return mesh


def changed(change):
    """A mesh of Netgen after a `change`."""
    mesh = boxes(("a", (0, 0, 0), (1, 1, 1), (1, 1, 1))).ngmesh
    change(mesh)
    return ng.Mesh(mesh)


def spare_vertex(mesh):
    mesh.Add(MeshPoint(Pnt(9, 8, 7)))


def side_of_two_names(mesh):
    mesh.Add(Element2D(2, mesh.Elements2D()[0].vertices))


def nameless_side(mesh):
    mesh.DeleteSurfaceElement(0)
    mesh.Compress()


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (lambda: changed(nameless_side), "have 11 of its 12 outer sides, and estimates"),
        (lambda: MakeStructured3DMesh(hexes=True, nx=1), "1 hexahedra, prisms or pyramids"),
        (mirrored, r"24 inverted.*tetrahedra.*signed volume -?0\.0833"),
        (lambda: blocks(1, 1), 'body "upper" has no material'),
        (curved_without_cad, "curved without a geometry"),
        (lambda: changed(spare_vertex), r"1 vertices of no element: number 8 at \[9.0, 8.0, 7.0\]"),
        (lambda: changed(Mesh.SecondOrder), "19 vertices of no element.*elements of first order"),
        (lambda: changed(side_of_two_names), "1 sides of elements occur twice in the boundaries"),
    ],
)
def test_meshes_that_are_refused(mesh, words):
    mesh = mesh()
    with pytest.raises(ValueError, match=words):
        solve(Problem(mesh, {mesh.GetMaterials()[-1]: SOFT}))


def test_unnamed_solids():
    with pytest.raises(ValueError, match="give every solid a name"):
        solve(Problem(occ.OCCGeometry(box("")), BOX))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"sliding": "lower_botom"}, ValueError, 'did you mean "lower_bottom"'),
        (
            {"contact": [Contact("upper_bottom", gap=gap_of_two)]},
            TypeError,
            "must take three arrays",
        ),
        (
            {"contact": [Contact("upper_bottom", gap=lambda x, y, z: x.astype(str))]},
            TypeError,
            "returns values of type <U32: return real numbers",
        ),
        (
            {"contact": [Contact("upper_top", "lower_bottom", direction=(0, 0, -1))]},
            ValueError,
            r"no point.*faces.*direction=\(0, 0, -1\)",
        ),
    ],
)
def test_data_that_do_not_fit(changes, error, words):
    problem = replace(pressed(blocks(2, 2)), traction={}, **changes)
    with pytest.raises(error, match=words):
        solve(replace(problem, sliding=changes.get("sliding")))


def test_what_stays_plane():
    problem = pressed(blocks(2, 2))
    for order in (4, 2.5):
        with pytest.raises(ValueError, match=f"order={order} is not available; solids have"):
            solve(problem, order=order)
    with pytest.raises(ValueError, match="leave it out with solids"):
        solve(problem, element="superparametric")
    solution = solve(problem)
    with pytest.raises(ValueError, match="mesh has dimension 2, and the bodies are solids"):
        solve(problem, MakeStructured2DMesh(quads=False, nx=1))
    assert solution.order == 2
    for name in ("hoop_stress", "out_of_plane_stress"):
        with pytest.raises(ValueError, match="a solid has no"):
            getattr(solution, name)
    with pytest.raises(ValueError, match="axisymmetric"):
        solution.revolved("body.vtu")
    with pytest.raises(ValueError, match="not available for solids"):
        solution.error_bound  # noqa: B018


@pytest.mark.parametrize("counts", [(2, 2), (3, 2), (2, 4)])
def test_prescribed_on_both_sides(counts):
    """Bodies that share a plane with prescribed displacements which overlap there."""
    given = {"upper_left": (0, 0, -0.1), "lower_left": (0, 0, 0)}
    problem = replace(pressed(blocks(*counts)), sliding=None, traction={}, displacement=given)
    with pytest.raises(ValueError, match="violated by prescribed displacements on both sides"):
        solve(problem)


def test_a_start_in_another_dimension():
    solid, plane = pressed(blocks(2, 2)), solve(cases.pressure_patch().problem, maxh=0.5)
    with pytest.raises(ValueError, match="solution of 2 dimensions, the problem is of 3"):
        solve(solid, start=plane)
    with pytest.raises(ValueError, match="solution of 3 dimensions, the problem is of 2"):
        solve(plane.problem, plane.mesh, start=solve(solid))


def two_boxes(first, second, **data):
    mesh = boxes(("a", *first, (3, 3, 3)), ("b", *second, (2, 2, 2)))
    held = {"b_bottom": (0, 0, 0)}
    return Problem(geometry=mesh, materials={"a": SOFT, "b": SOFT}, displacement=held | data)


def test_solids_drawn_with_two_dimensions():
    """Which turns some of their faces inside out."""
    geometry = occ.OCCGeometry(occ.Compound([box()]), dim=2)
    problem = Problem(geometry, materials=BOX, displacement={"a_side": (0, 0, 0)})
    with pytest.raises(ValueError, match="as dim=2 turns faces inside out"):
        solve(problem, maxh=0.7)


def test_bodies_on_top_of_each_other():
    """Of the smaller one more than a half lies in the other; an interference does not."""
    for depth in (0.6, 1.0):
        problem = two_boxes(((0.1, 0.1, -depth), (0.9, 0.9, 1 - depth)), ((0, 0, -1), (1, 1, 0)))
        with pytest.raises(ValueError, match=r"lie on top of each other, about .* of volume"):
            solve(problem)
    solve(two_boxes(((0, 0, -0.2), (1, 1, 0.8)), ((0, 0, -1), (1, 1, 0)), a_top=(0, 0, 0)))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"a_left": (0, 0, 0), "a_back": (0, 0, 0.1)}, "prescribe 0 and 0.1 along z at their edge"),
        ({"a_left": (None, 0.1, 0), "sliding": "a_front"}, '"a_left" leads -?0.1 across the guide'),
        ({"a_left|a_back": (0, 0, ng.x)}, ""),
        ({"a_left": (0.1, 0, 0), "sliding": "a_front"}, ""),
    ],
)
def test_supports_that_contradict_each_other(data, words):
    sliding = data.pop("sliding", None)
    problem = two_boxes(((0, 0, 1), (1, 1, 2)), ((0, 0, -1), (1, 1, 0)), **data)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        solve(replace(problem, sliding=sliding), order=1)
    assert len(told) == bool(words)
    assert all(re.search(words, str(one.message)) for one in told)
