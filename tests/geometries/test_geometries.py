"""The gallery: names, areas, orientation, curves and coincident vertices of every geometry."""

import inspect
import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import OCCGeometry

from ngcontact import geometries
from ngcontact.geometries import (
    ball_in_socket,
    blocks,
    cone_on_block,
    disc,
    disc_on_block,
    disc_on_disc,
    graphs,
    punch,
    ring_in_groove,
    rings,
    rounded_punch,
    sleeve_on_shaft,
)

PI = math.pi
LINE = ((-1.0, 0.0), (-0.2, 0.3), (0.5, -0.1), (1.0, 0.2))  # a convex and a re-entrant corner
BLOCK_SIDES = {
    f"{body}_{side}" for body in ("upper", "lower") for side in ("contact", "left", "right")
} | {"top", "bottom"}
PUNCH = {"punch_top", "punch_sides", "punch_contact", "foundation_contact"} | {
    f"foundation_{part}" for part in ("free", "sides", "bottom")
}
DISC_ON_BLOCK = {"disc_top", "disc_arc", "block_top", "block_bottom", "side"}
DISC_ON_DISC = {"top", "bottom", "upper_arc", "lower_arc"}
RINGS = {"hole", "inner_contact", "outer_contact", "rim"}
CUTS = {f"{body}_cut_{axis}" for body in ("inner", "outer") for axis in "xy"}


def parabola(x: float) -> float:
    return x**2 / 2


def ripple(x: float) -> float:
    return 0.01 * math.sin(8 * PI * x)


def bowl(x: float) -> float:
    return 0.1 * math.sin(4 * x)


def flat(x: float) -> float:
    return -0.1


def flat_low(x: float) -> float:
    return -0.9


@dataclass(frozen=True)
class Case:
    """One call of the gallery and what its mesh must show; areas in the order of the bodies."""

    name: str
    make: Callable[[], OCCGeometry]
    areas: dict[str, float]
    boundaries: set[str]
    edges: int


BLOCK_ABOUT_AN_AXIS = {"block_top", "block_bottom", "side", "axis"}
INDENTER = BLOCK_ABOUT_AN_AXIS | {"indenter_side", "indenter_top"}
SLOPE = math.tan(math.radians(10))

CASES = [
    Case(
        "ball_in_socket",
        ball_in_socket,
        {"ball": PI / 4, "socket": 2.1 * 2.05 - 1.05**2 * PI / 4},
        {"ball_top", "ball_arc", "socket_arc", "socket_rim", "socket_bottom", "side", "axis"},
        8,
    ),
    Case(
        "cone_on_block",
        cone_on_block,
        {"indenter": 1 + SLOPE / 2, "block": 4.0},
        INDENTER | {"flank"},
        8,
    ),
    Case(
        "rounded_punch",
        rounded_punch,
        {"indenter": 1.2**2 - 0.2**2 * (1 - PI / 4), "block": 2.4**2},
        INDENTER | {"end"},
        9,
    ),
    Case(
        "sleeve_on_shaft",
        sleeve_on_shaft,
        {"shaft": 2.0, "sleeve": 0.6},
        {"shaft_contact", "shaft_free", "shaft_ends", "axis"}
        | {"sleeve_contact", "sleeve_ends", "rim"},
        10,
    ),
    Case(
        "ring_in_groove",
        ring_in_groove,
        {"ring": PI / 4, "housing": 3.4 * 1.75 - 1.4 * 0.75, "plate": 3.4},
        {"ring_lower", "ring_upper", "groove", "walls", "face", "plate_face"}
        | {"housing_bottom", "plate_top", "rims"},
        16,
    ),
    Case("blocks", blocks, {"upper": 2.0, "lower": 2.0}, BLOCK_SIDES, 8),
    Case(
        "blocks",
        lambda: blocks(line=LINE, height=0.8, lower_height=0.5),
        # trapezia under the line: 0.8 * 0.15 + 0.7 * 0.1 + 0.5 * 0.05 = 0.215
        {"upper": 1.6 - 0.215, "lower": 1.0 + 0.215},
        BLOCK_SIDES,
        12,
    ),
    Case("rings", rings, {"inner": 0.75 * PI, "outer": 3 * PI}, RINGS, 16),
    Case(
        "rings",
        lambda: rings(inner=1, interface=2, outer=3, interference=0.1),
        {"inner": 3 * PI, "outer": (9 - 1.9**2) * PI},
        RINGS,
        16,
    ),
    Case(
        "rings",
        lambda: rings(interference=-0.01, quarter=True),
        {"inner": 0.75 * PI / 4, "outer": (4 - 1.01**2) * PI / 4},
        RINGS | CUTS,
        8,
    ),
    Case("disc", disc, {"disc": PI / 4}, {"top", "arc", "axis"}, 3),
    Case("disc", lambda: disc(radius=2, symmetric=False), {"disc": 2 * PI}, {"top", "arc"}, 3),
    Case(
        "disc_on_block", disc_on_block, {"disc": PI / 4, "block": 4.0}, DISC_ON_BLOCK | {"axis"}, 7
    ),
    Case(
        "disc_on_block",
        lambda: disc_on_block(radius=2, width=1.5, height=1, symmetric=False),
        {"disc": 2 * PI, "block": 3.0},
        DISC_ON_BLOCK,
        8,
    ),
    Case(
        "disc_on_disc", disc_on_disc, {"upper": PI / 4, "lower": PI / 4}, DISC_ON_DISC | {"axis"}, 6
    ),
    Case(
        "disc_on_disc",
        lambda: disc_on_disc(radius=0.5, lower_radius=1, symmetric=False),
        {"upper": PI / 8, "lower": PI / 2},
        DISC_ON_DISC,
        6,
    ),
    Case(
        "graphs",
        lambda: graphs(parabola, flat),
        {"upper": 2 - 1 / 3, "lower": 1.8},
        BLOCK_SIDES,
        8,
    ),
    Case(
        "graphs",
        # over [0, 1] the ripple has mean zero, the bowl (1 - cos 4) / 40
        lambda: graphs(bowl, ripple, a=0, b=1, height=0.5),
        {"upper": 0.5 - (1 - math.cos(4)) / 40, "lower": 0.5},
        BLOCK_SIDES,
        8,
    ),
    Case("punch", punch, {"punch": 1.0, "foundation": 32.0}, PUNCH, 10),
    Case(
        "punch",
        lambda: punch(half_width=1, punch_height=0.5, width=3, depth=2),
        {"punch": 1.0, "foundation": 12.0},
        PUNCH,
        10,
    ),
]
every_case = pytest.mark.parametrize(
    "case", CASES, ids=[f"{case.name}-{k}" for k, case in enumerate(CASES)]
)


def mesh_of(geometry: OCCGeometry, maxh: float = 0.4, order: int = 3) -> ng.Mesh:
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=maxh))
    mesh.Curve(order)
    return mesh


def vertices_on(mesh: ng.Mesh, boundary: str) -> np.ndarray:
    numbers = {v.nr for element in mesh.Boundaries(boundary).Elements() for v in element.vertices}
    return np.array([mesh[ng.NodeId(ng.VERTEX, nr)].point for nr in sorted(numbers)])


def edges_of(geometry: OCCGeometry, name: str) -> list:
    edges = [edge for edge in geometry.shape.edges if edge.name == name]
    assert edges, name
    return edges


def ends_of(geometry: OCCGeometry, name: str) -> np.ndarray:
    points = [point for edge in edges_of(geometry, name) for point in (edge.start, edge.end)]
    return np.array(sorted({(round(p.x, 13), round(p.y, 13)) for p in points})) + 0.0


def divergence_defect(mesh: ng.Mesh) -> float:
    """Relative defect of the divergence theorem for the field (x, y)."""
    position = ng.CF((ng.x, ng.y))
    inside = ng.Integrate(ng.CF(2), mesh)
    through = ng.Integrate(position * ng.specialcf.normal(2), mesh, ng.BND)
    return abs(through / inside - 1)


def test_every_public_geometry_has_a_case_here() -> None:
    assert {case.name for case in CASES} == set(geometries.__all__)
    assert len(set(geometries.__all__)) == len(geometries.__all__)


@pytest.mark.parametrize("name", geometries.__all__)
def test_docstring_lists_exactly_the_regions(name: str) -> None:
    found: set[str] = set()
    for case in CASES:
        if case.name == name:
            mesh = mesh_of(case.make(), order=1)
            found |= set(mesh.GetMaterials()) | set(mesh.GetBoundaries())
    text = inspect.getdoc(getattr(geometries, name))  # not indented, by any version of Python
    listed = re.findall(r"^``(\w+)`` ", text, flags=re.MULTILINE)
    assert found == set(listed)


@every_case
def test_names_are_as_promised(case: Case) -> None:
    geometry = case.make()
    mesh = mesh_of(geometry, order=1)
    assert mesh.dim == 2
    assert mesh.GetMaterials() == tuple(case.areas)
    assert set(mesh.GetBoundaries()) == case.boundaries
    assert len(geometry.shape.edges) == case.edges


@every_case
@pytest.mark.study(witness=["disc-10", "disc_on_disc-15", "disc_on_disc-14"])
def test_areas_are_exact(case: Case) -> None:
    geometry = case.make()
    mass = {face.name: face.mass for face in geometry.shape.faces}
    # CAD area: measured at most 6e-16, with splines too.
    assert mass == pytest.approx(case.areas, rel=1e-12)
    mesh = mesh_of(geometry, maxh=0.15)
    area = dict(zip(mesh.GetMaterials(), ng.Integrate(1, mesh, region_wise=True), strict=True))
    # Area of the order-3 mesh: measured at most 1.7e-5 (disc_on_disc, radius 0.5).
    assert area == pytest.approx(case.areas, rel=1e-4)


@every_case
def test_normals_point_outwards_also_after_refinement(case: Case) -> None:
    mesh = mesh_of(case.make())
    # Theory: exact, both sides integrate the same polynomials; round-off measured 2e-15. Edges
    # with the body on their right miss it by 2; a refined mesh that is not curved again by 1e-4.
    assert divergence_defect(mesh) < 1e-12
    mesh.Refine()
    mesh.Curve(3)
    assert divergence_defect(mesh) < 1e-12


CURVES = {
    "ring": (rings, "inner_contact|outer_contact", lambda x, y: np.hypot(x, y) - 1),
    "hole": (lambda: rings(quarter=True), "hole", lambda x, y: np.hypot(x, y) - 0.5),
    "disc": (disc_on_block, "disc_arc", lambda x, y: np.hypot(x, y - 1) - 1),
    "lower disc": (
        lambda: disc_on_disc(lower_radius=2, symmetric=False),
        "lower_arc",
        lambda x, y: np.hypot(x, y + 2) - 2,
    ),
    "Bezier": (lambda: graphs(parabola, flat), "upper_contact", lambda x, y: y - x**2 / 2),
    "spline": (lambda: graphs(bowl, flat), "upper_contact", lambda x, y: y - 0.1 * np.sin(4 * x)),
}


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.study(witness=["hole", "Bezier", "spline"])
def test_curved_mesh_follows_the_exact_curve(curve: str) -> None:
    make, boundary, distance = CURVES[curve]
    at = [(t, 0, 0) for t in np.linspace(0, 1, 7)]
    deviation = []
    for maxh in (0.2, 0.1):
        mesh = mesh_of(make(), maxh=maxh)
        # On the CAD edge to round-off; measured at most 6e-15 (spline).
        assert np.abs(distance(*vertices_on(mesh, boundary).T)).max() < 1e-13
        points = mesh.MapToAllElements(
            ng.IntegrationRule(at, [1.0] * len(at)), mesh.Boundaries(boundary)
        )
        x, y = ng.x(points).ravel(), ng.y(points).ravel()
        deviation.append(np.abs(distance(x, y)).max())
    # Theory: cubic segments are off by O(h^4); measured rates 3.8 to 4.25.
    assert math.log2(deviation[0] / deviation[1]) == pytest.approx(4, abs=0.3)
    assert deviation[1] < 1e-5  # measured 5e-8 (lower disc) to 3.1e-6 (spline)


@pytest.mark.parametrize(
    ("f", "bound"),
    [
        (parabola, 1e-14),  # a Bezier curve: round-off
        (lambda x: x**8 / 3, 1e-14),  # the highest degree recognised: measured 1e-15
        (ripple, 1e-10),  # measured 3.7e-11, order 6 in the spacing of the samples
        (bowl, 1e-13),  # measured 6e-15
        (lambda x: 5 - math.sqrt(25 - x**2), 1e-14),  # measured 1e-15
        (lambda x: 1e-3 * abs(x) ** 1.5, 1e-7),  # measured 4.2e-8: curvature unbounded at 0
    ],
)
def test_graph_edge_follows_the_function(f: Callable[[float], float], bound: float) -> None:
    (edge,) = edges_of(graphs(f, flat_low), "upper_contact")
    start, end = edge.parameter_interval
    points = [edge.Value(t) for t in np.linspace(start, end, 2001)]
    assert max(abs(p.y - f(p.x)) for p in points) < bound
    # x is linear in the parameter by construction: round-off.
    assert np.abs([p.x for p in points] - np.linspace(-1, 1, 2001)).max() < 1e-14


@pytest.mark.parametrize("interference", [0.05, 0.0, -0.05])
def test_rings_have_vertices_at_equal_angles(interference: float) -> None:
    geometry = rings(interference=interference)
    inner, outer = ends_of(geometry, "inner_contact"), ends_of(geometry, "outer_contact")
    assert len(inner) == 4
    assert outer == pytest.approx(inner * (1 - interference), abs=1e-12)  # rounded by ends_of
    assert {(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)} == set(map(tuple, inner))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: blocks(width=0), ValueError, "width = 0: expected a positive"),
        (lambda: blocks(height=-1.0), ValueError, "height = -1.0: expected a positive"),
        (lambda: blocks(lower_height=math.nan), ValueError, "lower_height = nan: expected a"),
        (lambda: blocks(width="2"), TypeError, "width = '2': expected a real number"),
        (lambda: blocks(width=True), TypeError, "width = True: expected a real number"),
        (lambda: blocks(line=((0, 0),)), ValueError, "at least two vertices"),
        (lambda: blocks(line=3), TypeError, "line = 3: expected at least two"),
        (lambda: blocks(line=((0, 0), 1)), TypeError, "line[1] = 1: expected at least two"),
        (lambda: blocks(line=((0, 0), (1, 0, 0))), TypeError, "line[1] = (1, 0, 0)"),
        (lambda: blocks(line=((0, 0), (1, "a"))), TypeError, "line[1][1] = 'a'"),
        (lambda: blocks(line=((0, 0), (0, 1))), ValueError, "line[1] = (0, 1) follows x = 0.0"),
        (lambda: blocks(line=((0, 0), (1, 1))), ValueError, "line[1] = (1.0, 1.0): expected y"),
        (lambda: blocks(line=((0, -1), (1, 0))), ValueError, "line[0] = (0.0, -1.0): expected y"),
        (lambda: rings(inner=0), ValueError, "inner = 0: expected a positive"),
        (lambda: rings(interface=0.5), ValueError, "interface = 0.5: expected more than inner"),
        (lambda: rings(outer=1), ValueError, "outer = 1: expected more than interface = 1.0"),
        (lambda: rings(interference=0.5), ValueError, "interference = 0.5: expected more than"),
        (lambda: rings(interference=-1), ValueError, "interference = -1: expected more than"),
        (lambda: rings(quarter="yes"), TypeError, "quarter = 'yes': expected True or False"),
        (lambda: disc_on_block(radius=-2), ValueError, "radius = -2: expected a positive"),
        (lambda: disc_on_block(width=0), ValueError, "width = 0: expected a positive"),
        (lambda: disc_on_block(height=math.inf), ValueError, "height = inf: expected a finite"),
        (lambda: disc_on_block(symmetric=1), TypeError, "symmetric = 1: expected True or False"),
        (lambda: disc(radius=0.0), ValueError, "radius = 0.0: expected a positive"),
        (lambda: disc_on_disc(radius=0.0), ValueError, "radius = 0.0: expected a positive"),
        (lambda: disc_on_disc(lower_radius=-1), ValueError, "lower_radius = -1: expected a pos"),
        (lambda: disc_on_disc(symmetric=None), TypeError, "symmetric = None: expected True"),
        (lambda: graphs(1.0, flat), TypeError, "upper = 1.0: expected a function"),
        (lambda: graphs(flat, lambda x, y: 0), TypeError, "lower = <function"),
        (lambda: graphs(flat, lambda x: "a"), TypeError, "lower(-1.0) = 'a': expected a real"),
        (lambda: graphs(flat, lambda x: math.nan), ValueError, "lower(-1.0) = nan"),
        (lambda: graphs(flat, flat, a=2), ValueError, "b = 1.0: expected more than a = 2.0"),
        (lambda: graphs(flat, flat, height=0), ValueError, "height = 0: expected a positive"),
        (lambda: graphs(flat, flat, samples=3), ValueError, "samples = 3: expected at least 16"),
        (lambda: graphs(flat, flat, samples=99.5), TypeError, "samples = 99.5: expected a whole"),
        (lambda: graphs(parabola, flat, height=0.5), ValueError, "upper: values from"),
        (lambda: graphs(flat, parabola, height=0.3), ValueError, "lower: values from"),
        (lambda: graphs(abs, flat), ValueError, "upper: the edge misses the graph by 1.3e-03"),
        (lambda: graphs(ripple, flat, samples=20), ValueError, "raise samples"),
        (lambda: punch(half_width=-0.5), ValueError, "half_width = -0.5: expected a positive"),
        (lambda: punch(punch_height=0), ValueError, "punch_height = 0: expected a positive"),
        (lambda: punch(width=0.5), ValueError, "width = 0.5: expected more than half_width = 0.5"),
        (lambda: punch(depth=-4), ValueError, "depth = -4: expected a positive"),
        (lambda: blocks(width=1e-7), ValueError, "use a smaller unit of length"),
    ],
)
def test_bad_parameters_are_refused(
    call: Callable[[], OCCGeometry], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=re.escape(message)):
        call()
