"""Refinement: copies, matched contact lines, exact curves, positive triangles, local marks."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import ngsolve as ng
import numpy as np
import pytest
from netgen.meshing import Element1D, Element2D, FaceDescriptor, Mesh, MeshPoint, Pnt
from netgen.occ import OCCGeometry

from ngcontact import Contact, Elastic, Problem
from ngcontact.adaptivity import Refining, refined
from ngcontact.adaptivity.forecast import touching
from ngcontact.fem import boundary_trace
from ngcontact.geometries import blocks, disc_on_block, disc_on_disc, graphs, rings
from ngcontact.mesh import curve, first_mesh
from ngcontact.problem import Triangulation
from tests.scenes import coordinates, vertices

SOFT = Elastic(E=1.0, nu=0.3)
LINE = ((-1.0, 0.0), (-0.4, 0.25), (0.3, -0.2), (1.0, 0.1))
ROUND_OFF = 1e-12  # of coordinates of size 1; the published method's nodes match exactly
LEVELS = 6


def wave(x: float) -> float:
    return 0.02 + 0.01 * math.sin(9 * x)


def valley(x: float) -> float:
    return -0.2 * math.cos(3 * x)


@dataclass(frozen=True)
class Pair:
    """A geometry, its pair, the heights of both lines over x or their radius, the matched part."""

    geometry: Callable[[], OCCGeometry]
    bodies: tuple[str, str]
    contact: Contact
    secondary: Callable[[float], float] | None = None
    primary: Callable[[float], float] | None = None
    part: float = math.inf

    def problem(self) -> Problem:
        return Problem(
            geometry=self.geometry(),
            materials=dict.fromkeys(self.bodies, SOFT),
            contact=[self.contact],
        )


BLOCKS = ("upper", "lower")
BOUNDED = {
    "blocks": Pair(blocks, BLOCKS, Contact("upper_contact", "lower_contact")),
    "polygon": Pair(lambda: blocks(line=LINE), BLOCKS, Contact("lower_contact", "upper_contact")),
    "rings": Pair(
        lambda: rings(quarter=True), ("inner", "outer"), Contact("outer_contact", "inner_contact")
    ),
    "whole rings": Pair(rings, ("inner", "outer"), Contact("inner_contact", "outer_contact")),
}
ENLARGING = {
    "blocks": Pair(
        blocks,
        BLOCKS,
        Contact("lower_contact", "upper_contact", direction=(0, 1)),
        lambda x: 0.0,
        lambda x: 0.0,
    ),
    "graphs": Pair(
        lambda: graphs(wave, valley),
        BLOCKS,
        Contact("lower_contact", "upper_contact", direction=(0, 1)),
        valley,
        wave,
    ),
    "disc on block": Pair(
        disc_on_block,
        ("disc", "block"),
        Contact("disc_arc", "block_top", direction=(0, -1)),
        lambda x: 1 - math.sqrt(1 - x * x),
        lambda x: 0.0,
        part=0.8,
    ),
    "disc on disc": Pair(
        lambda: disc_on_disc(lower_radius=2.0, symmetric=False),
        BLOCKS,
        Contact("lower_arc", "upper_arc", direction=(0, 1)),
        lambda x: math.sqrt(4 - x * x) - 2,
        lambda x: 1 - math.sqrt(1 - x * x),
        part=0.8,
    ),
}
ALL = {f"bounded {k}": v for k, v in BOUNDED.items()} | {
    f"enlarging {k}": v for k, v in ENLARGING.items()
}


def shapes(mesh):
    """Signed areas (ne,) and smallest angles in degrees (ne,) of the straight triangles."""
    corners = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(int) - 1
    return shapes_of(coordinates(mesh)[corners])


def shapes_of(corners):
    """The same of triangles with the corners (ne, 3, 2)."""
    side = np.roll(corners, -1, axis=1) - corners
    area = (side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]) / 2
    length = np.linalg.norm(side, axis=2)
    cosine = -(side * np.roll(side, 1, axis=1)).sum(axis=2) / length / np.roll(length, 1, axis=1)
    return area, np.degrees(np.arccos(cosine.clip(-1, 1))).min(axis=1)


def near_tip(mesh, pattern, distance):
    """Elements at segments of a boundary whose middle is near its vertex nearest to (0.05, 0)."""
    trace = boundary_trace(mesh, 1)
    segments = trace.segments(pattern)
    points = vertices(mesh, pattern)
    tip = points[np.linalg.norm(points - [0.05, 0], axis=1).argmin()]
    middle = trace.curve[segments].mean(axis=1)
    marked = np.zeros(mesh.ne, dtype=bool)
    marked[trace.element[segments[np.linalg.norm(middle - tip, axis=1) <= distance]]] = True
    return marked


@pytest.fixture(scope="module")
def locally_refined():
    """Mesh of a pair before and after six levels marked on one side only, kept between tests."""
    kept = {}

    def make(name, side):
        if (name, side) not in kept:
            problem = ALL[name].problem()
            mesh = first = first_mesh(problem, 0.4)
            for level in range(LEVELS):
                marked = near_tip(mesh, getattr(ALL[name].contact, side), 0.5 / 2**level)
                assert marked.any()
                mesh, _ = curve(refined(problem, mesh, marked), 2, "isoparametric")
            kept[name, side] = first, mesh
        return kept[name, side]

    return make


SIDES = pytest.mark.parametrize("side", ["secondary", "primary"])


@SIDES
@pytest.mark.parametrize("name", BOUNDED)
def test_facing_vertices_of_a_bounded_zone_stay_matched(locally_refined, name, side):
    contact = BOUNDED[name].contact
    first, mesh = locally_refined(f"bounded {name}", side)
    here, there = vertices(mesh, contact.secondary), vertices(mesh, contact.primary)
    assert len(here) >= len(vertices(first, contact.secondary)) + LEVELS
    distance = np.linalg.norm(here[:, None] - there, axis=2)
    assert distance.min(axis=0).max() < ROUND_OFF
    assert distance.min(axis=1).max() < ROUND_OFF


@SIDES
@pytest.mark.parametrize("name", ENLARGING)
def test_facing_vertices_of_an_enlarging_zone_keep_common_eta(locally_refined, name, side):
    pair = ENLARGING[name]
    _, mesh = locally_refined(f"enlarging {name}", side)
    eta = []
    for boundary, height in (
        (pair.contact.secondary, pair.secondary),
        (pair.contact.primary, pair.primary),
    ):
        points = vertices(mesh, boundary)
        x, y = points[np.abs(points[:, 0]) < pair.part].T
        assert np.abs(y - [height(v) for v in x]).max() < ROUND_OFF
        eta.append(x)
    assert len(eta[0]) > LEVELS
    distance = np.abs(eta[0][:, None] - eta[1])
    assert distance.min(axis=0).max() < ROUND_OFF
    assert distance.min(axis=1).max() < ROUND_OFF


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ALL)
def test_the_divergence_theorem_holds_on_the_curved_mesh(locally_refined, name, order):
    # Volume elements that lost their curvature miss it by 1e-2: mesh.Refine() straightens them.
    _, mesh = locally_refined(name, "secondary")
    mesh = ng.Mesh(mesh.ngmesh.Copy())
    mesh.Curve(order)
    position, quadrature = ng.CF((ng.x, ng.y)), 2 * order + 2
    inside = ng.Integrate(ng.CF(2), mesh, order=quadrature)
    around = ng.Integrate(position * ng.specialcf.normal(2), mesh, ng.BND, order=quadrature)
    assert around == pytest.approx(inside, rel=1e-13)


@SIDES
@pytest.mark.parametrize("name", ALL)
def test_triangles_stay_positive_and_well_shaped(locally_refined, name, side):
    first, mesh = locally_refined(name, side)
    area, angle = shapes(mesh)
    assert area.min() > 0
    # Bisection at most halves an angle once, whatever the number of levels; moving vertices along
    # curves costs little more (measured: 0.42 of the first mesh at worst).
    assert angle.min() > 0.38 * shapes(first)[1].min()


@SIDES
@pytest.mark.parametrize("name", ALL)
def test_refinement_stays_local(locally_refined, name, side):
    first, mesh = locally_refined(name, side)
    # About 50 more elements a level on both sides together; uniform levels have 4^6 times as many.
    assert mesh.ne < first.ne + 80 * LEVELS
    area, _ = shapes(mesh)
    assert area.max() == pytest.approx(shapes(first)[0].max(), rel=0.5)


def test_an_unmarked_facing_segment_is_divided_once_and_no_further():
    problem = BOUNDED["blocks"].problem()
    mesh = first_mesh(problem, 0.25)
    trace = boundary_trace(mesh, 1)
    upper = trace.segments("upper_contact")
    marked = np.zeros(mesh.ne, dtype=bool)
    marked[trace.element[upper[len(upper) // 2]]] = True
    result = refined(problem, mesh, marked)
    new = {
        side: set(map(tuple, vertices(result, side).round(12)))
        - set(map(tuple, vertices(mesh, side).round(12)))
        for side in ("upper_contact", "lower_contact")
    }
    assert new["upper_contact"] == new["lower_contact"]
    assert len(new["upper_contact"]) == 1


@pytest.mark.parametrize("name", ALL)
def test_uniform_refinement_quadruples_the_elements(name):
    problem = ALL[name].problem()
    mesh = first_mesh(problem, 0.5)
    result = refined(problem, mesh)
    assert result.ne == 4 * mesh.ne
    assert result.nv == mesh.nv + mesh.nedge
    assert len(list(result.Elements(ng.BND))) == 2 * len(list(mesh.Elements(ng.BND)))


@SIDES
@pytest.mark.parametrize("name", ["bounded polygon", "enlarging blocks"])
def test_parts_lie_in_their_parents_and_fill_them(name, side):
    problem = ALL[name].problem()
    refining = Refining(problem, first_mesh(problem, 0.4))
    for level in range(4):
        old = Triangulation(refining.mesh).corners
        marked = near_tip(refining.mesh, getattr(ALL[name].contact, side), 0.5 / 2**level)
        parent = refining.bisect(marked)
        new = Triangulation(refining.mesh).corners
        assert (parent[: len(old)] == np.arange(len(old))).all()
        centres = new.mean(axis=1)
        inside = [touching(old[i : i + 1], centres[k : k + 1])[0, 0] for k, i in enumerate(parent)]
        assert all(inside)
        area = shapes(refining.mesh)[0]
        assert np.bincount(parent, area) == pytest.approx(shapes_of(old)[0], rel=1e-12)
        assert (np.bincount(parent)[marked] >= 2).all()


@pytest.mark.parametrize("name", ["enlarging disc on block", "bounded rings"])
def test_several_bisections_keep_contact_lines_matched(name):
    """As after as many refinements one by one; curves are met when all of them are done."""
    pair = ALL[name]
    problem = pair.problem()
    refining = Refining(problem, first_mesh(problem, 0.4))
    for level in range(3):
        refining.bisect(near_tip(refining.mesh, pair.contact.primary, 0.5 / 2**level))
    mesh = refining.finished()
    here, there = vertices(mesh, pair.contact.secondary), vertices(mesh, pair.contact.primary)
    if pair.contact.direction is not None:  # common eta, not common points
        here, there = (points[np.abs(points[:, 0]) < pair.part, :1] for points in (here, there))
    assert (
        len(here) == len(there) > len(vertices(first_mesh(problem, 0.4), pair.contact.primary)) / 2
    )
    distance = np.linalg.norm(here[:, None] - there, axis=2)
    assert distance.min(axis=0).max() < ROUND_OFF
    assert distance.min(axis=1).max() < ROUND_OFF


def squares_without_cad(n=4):
    """Unit squares above and below y = 0, n x n divided, made by hand."""
    mesh = Mesh(dim=2)
    for k, (name, low) in enumerate((("upper", 0.0), ("lower", -1.0))):
        p = [
            [mesh.Add(MeshPoint(Pnt(i / n, low + j / n, 0))) for i in range(n + 1)]
            for j in range(n + 1)
        ]
        face = mesh.Add(FaceDescriptor(surfnr=k + 1, domin=k + 1, bc=k + 1))
        mesh.SetMaterial(k + 1, name)
        for i, j in np.ndindex(n, n):
            mesh.Add(Element2D(face, [p[j][i], p[j][i + 1], p[j + 1][i + 1]]))
            mesh.Add(Element2D(face, [p[j][i], p[j + 1][i + 1], p[j + 1][i]]))
        right, left = [row[-1] for row in p], [row[0] for row in p[::-1]]
        sides = {"bottom": p[0], "right": right, "top": p[-1][::-1], "left": left}
        for number, (side, line) in enumerate(sides.items(), start=4 * k + 1):
            for ends in pairwise(line):
                mesh.Add(Element1D(list(ends), index=number))
            mesh.SetBCName(number - 1, f"{name}_{side}")
    return ng.Mesh(mesh)


def test_a_mesh_without_cad_stays_matched():
    mesh = squares_without_cad()
    problem = Problem(
        geometry=mesh,
        materials=dict.fromkeys(BLOCKS, SOFT),
        contact=[
            Contact("upper_bottom", "lower_top"),
            Contact("lower_bottom", direction=(0, -1), gap=0.1),
        ],
    )
    for _ in range(3):
        mesh = refined(problem, mesh, near_tip(mesh, "lower_top", 0.3))
    here, there = (np.sort(vertices(mesh, n)[:, 0]) for n in ("upper_bottom", "lower_top"))
    assert np.diff(here).min() == 0.25 / 2**3
    assert np.diff(here).max() == 0.25
    assert here == pytest.approx(there, abs=ROUND_OFF)
    assert problem.geometry.ne == 64
