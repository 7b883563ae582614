"""The problem as data: what is kept, and every refusal with its value and its remedy."""

import copy
import math

import netgen.meshing
import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Box, Compound, Glue, OCCGeometry, Pnt, WorkPlane
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact.geometries import blocks
from ngcontact.problem import numbers
from ngcontact.problem.contact import Contact
from ngcontact.problem.material import Elastic, Hooke
from ngcontact.problem.problem import Problem
from tests.scenes import rectangle

STEEL = Elastic(E=210e9, nu=0.3)
NAN = ng.sqrt(-1 - ng.x * ng.x)  # not a number at every point
TOUCH = Contact("punch_bottom", "block_top", direction=(0, -1))


def shapes():
    return [
        rectangle("block", (0, 2), (0, 1), ("bottom", "right", "block_top", "left")),
        rectangle("punch", (0, 2), (1, 2), ("punch_bottom", "right", "top", "left")),
    ]


def clockwise():
    """Netgen tells of a triangulation, and never returns where the face is not convex."""
    face = WorkPlane().LineTo(0, 1).LineTo(2, 1).LineTo(2, 0).Close().Face()
    face.name = "a"
    return OCCGeometry(face, dim=2)


@pytest.fixture(scope="module")
def geometry():
    return OCCGeometry(Compound(shapes()), dim=2)


@pytest.fixture(scope="module")
def mesh(geometry):
    return ng.Mesh(geometry.GenerateMesh(maxh=0.5))


@pytest.fixture
def make(geometry):
    """Return a valid problem with some arguments replaced."""

    def build(**changes):
        arguments = {
            "geometry": geometry,
            "materials": {"block": STEEL, "punch": STEEL},
            "displacement": {"bottom": (0, 0)},
            "contact": [TOUCH],
        }
        return Problem(**(arguments | changes))

    return build


def test_contact_normalises():
    pair = Contact("a", "b", direction=(3, -4), gap=2)
    assert pair.direction == pytest.approx((0.6, -0.8), rel=1e-15)
    assert (pair.gap, type(pair.gap)) == (2.0, float)
    for size in (5e-324, 1e-200, 1e308):  # squares under- or overflow
        x, y = Contact("a", "b", direction=np.array([size, size])).direction
        assert x == y == pytest.approx(math.sqrt(0.5), rel=1e-15)
    assert Contact("a", gap=ng.x).primary is None
    assert Contact("a", gap=max).gap is max
    assert Contact("a", "b").direction is None
    with pytest.raises(ValueError, match=r"a rigid obstacle .* cannot be the secondary"):
        Contact("a", gap=0).swapped()


def test_problem_normalises(make, mesh):
    materials = {"block": STEEL, "punch": STEEL}
    displacement = {"bottom": (0, None), "left": ng.CF((ng.x, 2)), "top": [None, np.float64(3)]}
    problem = make(
        materials=materials,
        displacement=displacement,
        sliding=["right", "axis"],
        traction={"a": 5, "b": (1, ng.y), "c": ng.CF((1, 2)), "d": ng.x},
        force={"block": np.array([0, -9.81])},
    )
    materials.clear()
    displacement.clear()
    assert list(problem.materials) == ["block", "punch"]
    at = mesh(0.25, 0.5)
    values = {
        name: tuple(None if part is None else part(at) for part in pair)
        for name, pair in problem.displacement.items()
    }
    left = pytest.approx((0.25, 2), rel=1e-14)  # round-off of the place
    assert values == {"bottom": (0, None), "left": left, "top": (None, 3)}
    assert problem.sliding == "right|axis"
    assert [load.dim for load in problem.traction.values()] == [1, 2, 2, 1]
    assert problem.traction["b"](at) == (1, 0.5)
    assert problem.force["block"](at) == (0, -9.81)
    assert problem.contact == (TOUCH,)
    assert repr(problem) == (
        'Problem(plane strain; bodies block, punch; contact "punch_bottom" with "block_top")'
    )
    assert make(displacement=None).displacement == {}


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"secondary": 3}, TypeError, "secondary = 3: give a region name"),
        ({"primary": ["b"]}, TypeError, r"primary = \['b'\]: give a region name"),
        ({"direction": (0, 0)}, ValueError, r"direction = \(0\.0, 0\.0\): give a vector from"),
        ({"direction": (1, 0, 0, 0)}, ValueError, "has length 4: give a pair.*three for solids"),
        ({"direction": (math.inf, 1)}, ValueError, "direction = inf: give a finite"),
        ({"direction": (ng.x, 1)}, TypeError, r"direction = \(.*: give a pair of numbers"),
        ({"gap": math.nan}, ValueError, "gap = nan: give a finite number"),
        ({"gap": ng.CF((1, 2))}, ValueError, "gap is a CoefficientFunction of dim 2: give a sca"),
        ({"bilateral": 1}, TypeError, "bilateral = 1: give True or False"),
        ({"rows": "all"}, ValueError, "rows = 'all': choose one of"),
        ({"roles": "auto", "primary": None, "gap": 0}, ValueError, "obstacle has no other side"),
        ({"friction": 0.2}, TypeError, r"frictionless, .* no friction=0\.2.*topics/limits\.md"),
    ],
)
def test_contact_refuses(arguments, error, message):
    with pytest.raises(error, match=message):
        Contact(**({"secondary": "a", "primary": "b"} | arguments))


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"materials": {}}, ValueError, "materials = {}: give every body an Elastic or a Hooke"),
        ({"displacement": {"top": ng.x}}, ValueError, r'"top" is .* dims \(\): give a 2-vector'),
        ({"displacement": {"top": (0, math.nan)}}, ValueError, '"top" = nan: give a finite'),
        ({"displacement": {"top": (None, None)}}, ValueError, "None, None.*: leave the boundary"),
        ({"sliding": ["left", 1]}, TypeError, "an entry of sliding = 1: give a region name"),
        ({"traction": {"top": (1, None)}}, TypeError, 'traction "top" = None: give a real'),
        ({"traction": {"top": ng.CF((1, 2, 3))}}, ValueError, r"dims \(3,\): give a 2-vector"),
        ({"traction": {"top": ng.CF((1j, 2))}}, TypeError, '"top" is a complex .*: it must be r'),
        ({"force": [("block", (0, 1))]}, TypeError, r"force = \[.*: give a dict"),
        ({"contact": [TOUCH, ("a", "b")]}, TypeError, r"contact\[1\] = \('a', 'b'\): give a Con"),
        ({"geometry": clockwise()}, ValueError, "clockwise, its area is -2:"),
        ({"geometry": shapes()[0]}, TypeError, r"a Face, which OCCGeometry\(shape, dim=2\) wraps"),
        ({"sliding": 3}, TypeError, "sliding = 3: give a region name or a sequence of names"),
        ({"sliding": ""}, ValueError, 'sliding = "": give a region name'),
        ({"model": 2}, TypeError, "model = 2: give one of the strings"),
        ({"model": "solid"}, ValueError, "model = 'solid' is for solids: choose one of"),
    ],
)
def test_problem_refuses(make, changes, error, message):
    with pytest.raises(error, match=message):
        make(**changes)


OBSTACLE = {"secondary": "punch_bottom", "direction": (0, -1)}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sliding": "(a|b)x"}, r'sliding "\(a\|b\)x" selects no region; there are \[\'block_top'),
        ({"sliding": "left("}, r'"left\(" is no name and no regular expression'),
        ({"contact": [TOUCH, Contact("xyz", gap=0)]}, r'contact\[1\].secondary "xyz" sel.*there a'),
        ({"contact": [Contact("top", "blocktop")]}, r'\[0\].primary "blocktop" .*mean "block_top"'),
        ({"materials": {"block": STEEL, ".*": STEEL}}, r'"block" is both in .*"block" and in .*"'),
        ({"force": {"block": (0, 1), "b.*": (0, 1)}}, r'"block" is both in force .* every region '),
        ({"displacement": {"left": (0, 0), "left|top": (0, 1)}}, '"left" is both in .* region onc'),
        ({"sliding": "bottom"}, '"bottom" is both in sliding .* in displacement .*: keep one'),
        ({"traction": {"bottom": 1}}, '"bottom" is both in traction .* or leave a component free'),
        ({"sliding": "block_top"}, r'"block_top" is both in contact\[0\].primary .* takes no oth'),
        ({"traction": {"punch_bottom": 1}}, r'"punch_bottom" .*contact\[0\].secondary .* takes no'),
        ({"displacement": {"block_top": (None, 0)}}, '"block_top" .*displacement .* takes no oth'),
        ({"contact": [Contact(".*top", "block_top")]}, '"block_top" is both in .*: name two diff'),
        ({"contact": [Contact("punch_bottom", "top")]}, '"top" lie on the same body: .*Compound'),
        ({"materials": {".*": Elastic(ng.x - 1, 0.3)}}, r'".\*"\.E = -0\..* at \(.*\): Young.*pos'),
        ({"materials": {".*": Elastic(1, ng.y)}}, r'".\*"\.nu = .* at \(.*\): Poisson.*must lie'),
        (
            {"materials": {".*": Hooke(ng.x * ng.CF((1, 2, 0, 2, 1, 0, 0, 0, 1), dims=(3, 3)))}},
            r'".\*"\.C = .* at \(.*\): .*positive definite',
        ),
        ({"materials": {".*": Elastic(NAN, 0.3)}}, r'".\*"\.E = -?nan at'),
        ({"force": {"punch": (0, NAN)}}, r'force "punch" = \[0\.0, -?nan\] at \(.*, 1\..*must be '),
        ({"traction": {"top": NAN}}, r'traction "top" = \[-?nan\] at \(.*, 2\): must be finite'),
        ({"displacement": {"bottom": (0, 1 / ng.x)}}, r'"bottom" = \[.*inf\] at \(0, 0\): must be'),
        ({"contact": [Contact(gap=1 / ng.x, **OBSTACLE)]}, r'contact\[0\]\.gap of "punch_bottom" '),
        (
            {"contact": [TOUCH, Contact(gap=lambda x, y: x + np.nan, **OBSTACLE)]},
            r"contact\[1\]\.gap of .* = nan at \(.*, 1\): must be finite",
        ),
    ],
)
def test_check_refuses(make, mesh, changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes).check(mesh)


def empty():
    return ng.Mesh(netgen.meshing.Mesh(dim=2))


def solid():
    return ng.Mesh(
        OCCGeometry(Box(Pnt(0, 0, 0), Pnt(1, 1, 1))).GenerateMesh(maxh=1, parallel_meshing=False)
    )


def astray():
    mesh = ng.Mesh(blocks().GenerateMesh(maxh=1))
    mesh.ngmesh.Coordinates()[0, 0] = math.inf
    return mesh


def quadrilaterals():
    return MakeStructured2DMesh(quads=True, nx=2, ny=1)


@pytest.mark.parametrize(
    ("bad", "error", "message"),
    [
        (lambda: "mesh", TypeError, "mesh is a str: give an ngsolve.Mesh"),
        (empty, ValueError, "mesh has 0 elements: generate it"),
        (solid, ValueError, r"mesh has dimension 3.*make it with OCCGeometry\(shape, dim=2\)"),
        (astray, ValueError, "inverted or degenerate .* signed area"),
        (quadrilaterals, ValueError, "mesh has 2 quadrilaterals: it must be a triangulation"),
    ],
)
def test_check_refuses_the_mesh(make, bad, error, message):
    with pytest.raises(error, match=message):
        make().check(bad())


def test_data_cannot_be_changed_in_place(make):
    problem = make(traction={"top": 1.0}, force={"block": (0, -1)})
    for argument in ("materials", "displacement", "traction", "force"):
        data = getattr(problem, argument)
        name, before = next(iter(data)), dict(data)
        for change, *given in (
            *(("__setitem__", name, 10.0), ("__delitem__", name), ("pop", name)),
            *(("update", {name: 10.0}), ("__ior__", {name: 1.0})),
        ):
            with pytest.raises(TypeError, match=rf"problem\.{argument}.*dataclasses\.replace\("):
                getattr(data, change)(*given)
        assert dict(data) == before
        assert type(data | {}) is dict  # and what is made of it is the caller's
        assert copy.deepcopy(data).keys() == before.keys()


NORMAL = ng.specialcf.normal(2)
OF_NUMBERS = [
    *(ng.CF(1.5), ng.CF(-1e30), ng.CF(0), ng.CF((0, 0)), ng.CF((1, -2e-9)), 2 * ng.CF((0, 1))),
    *(NORMAL, -3 * NORMAL, ng.CF(2.0) * NORMAL, ng.CF((1.0, 2.0))[0]),
]
FUNCTIONS = [ng.x, ng.CF((1, ng.x)), ng.Parameter(2.0), ng.Parameter(2.0) * NORMAL, ng.exp(-ng.y)]


def test_data_of_numbers_alone_are_told_from_functions():
    """The former are nowhere looked at; taking a function for numbers would miss what it does."""
    assert all(map(numbers, OF_NUMBERS))
    assert not any(map(numbers, FUNCTIONS))


def test_a_traction_between_glued_bodies_is_refused():
    lower = rectangle("lower", (0, 1), (0, 1), ("side", "side", "between", "side"))
    upper = rectangle("upper", (0, 1), (1, 2), ("between", "side", "side", "side"))
    glued = Problem(
        OCCGeometry(Glue([lower, upper]), dim=2),
        {".*": Elastic(E=1.0, nu=0.3)},
        traction={"between": (0, -1)},
        contact=[],
    )
    with pytest.raises(ValueError, match=r'traction "between": the edge .* shared by two bodies'):
        glued.check(ng.Mesh(glued.geometry.GenerateMesh(maxh=1)))
