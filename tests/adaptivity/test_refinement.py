"""Refinement: matched contact lines, exact curves, positive triangles, local marks, parents."""

import ngsolve as ng
import numpy as np
import pytest

from ngcontact.adaptivity import refined
from ngcontact.fem import boundary_trace
from ngcontact.mesh import curve, first_mesh
from ngcontact.problem import MeshArrays
from tests.given_meshes import two_blocks
from tests.pairs import ALL, BLOCKS, BOUNDED, ROUND_OFF, pressed, unmatched
from tests.scenes import vertices

LEVELS = 6


def shapes(mesh):
    """Signed areas (ne,) and smallest angles in degrees (ne,) of the straight triangles."""
    corners = MeshArrays(mesh).corners
    side = np.roll(corners, -1, axis=1) - corners
    area = (side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]) / 2
    length = np.linalg.norm(side, axis=2)
    cosine = -(side * np.roll(side, 1, axis=1)).sum(axis=2) / length / np.roll(length, 1, axis=1)
    return area, np.degrees(np.arccos(cosine.clip(-1, 1))).min(axis=1)


def near_tip(mesh, pattern, distance):
    """Elements at segments of a boundary whose middle is near its vertex nearest to (0.05, 0)."""
    trace = boundary_trace(mesh, 1)
    segments, points = trace.segments(pattern), vertices(mesh, pattern)
    tip = points[np.linalg.norm(points - [0.05, 0], axis=1).argmin()]
    middle = trace.curve[segments].mean(axis=1)
    marked = np.zeros(mesh.ne, dtype=bool)
    marked[trace.element[segments[np.linalg.norm(middle - tip, axis=1) <= distance]]] = True
    return marked


def matched_points(pair, mesh):
    """What facing vertices have in common: places, or eta where the pair has a direction."""
    points = [vertices(mesh, side) for side in pair.sides]
    if pair.contact.direction is None:
        return points
    for at, height in zip(points, pair.curves, strict=True):
        x, y = at[np.abs(at[:, 0]) < pair.part].T
        assert np.abs(y - [height(v) for v in x]).max() < ROUND_OFF
    return [at[np.abs(at[:, 0]) < 0.9 * pair.part, 0] for at in points]


@pytest.mark.parametrize("side", ["secondary", "primary"])
@pytest.mark.parametrize("name", [name for name in ALL if "punch" not in name])
def test_six_levels_marked_on_one_side_only(name, side):
    """Lines stay matched, triangles positive and well shaped, the rest as it was."""
    pair = ALL[name]
    problem = pair.problem()
    mesh = first = first_mesh(problem, 0.4)
    for level in range(LEVELS):
        marked = near_tip(mesh, getattr(pair.contact, side), 0.5 / 2**level)
        assert marked.any()
        mesh, _ = curve(refined(problem, mesh, marked), 2, "isoparametric")
    here, there = matched_points(pair, mesh)
    assert len(here) > LEVELS
    assert unmatched(here, there) < ROUND_OFF
    area, angle = shapes(mesh)
    assert area.min() > 0
    # Bisection at most halves an angle once, whatever the number of levels; moving vertices along
    # curves costs little more (measured: 0.42 of the first mesh at worst).
    assert angle.min() > 0.38 * shapes(first)[1].min()
    # About 50 more elements a level on both sides together; uniform levels have 4^6 times as many.
    assert mesh.ne < first.ne + 80 * LEVELS
    assert area.max() == pytest.approx(shapes(first)[0].max(), rel=0.5)
    # Volume elements that lost their curvature miss it by 1e-2: mesh.Refine() straightens them.
    for order in (1, 3):
        mesh.Curve(order)
        around = ng.Integrate(ng.CF((ng.x, ng.y)) * ng.specialcf.normal(2), mesh, ng.BND, order=8)
        assert around == pytest.approx(ng.Integrate(ng.CF(2), mesh, order=8), rel=1e-13)
    if "rings" in name:
        for boundary, radius in (("hole", 0.5), ("inner_contact|outer_contact", 1.0), ("rim", 2)):
            distance = np.linalg.norm(vertices(mesh, boundary), axis=1)
            assert np.abs(distance - radius).max() < ROUND_OFF


def test_an_element_amid_a_body_is_refined_alone():
    """No vertex of the boundary is new then, of which the other side would ask for its like."""
    problem = BOUNDED["blocks"].problem()
    mesh = first_mesh(problem, 0.1)
    marked = np.zeros(mesh.ne, dtype=bool)
    marked[np.linalg.norm(MeshArrays(mesh).corners.mean(axis=1) - [0.5, 0.5], axis=1).argmin()] = (
        True
    )
    finer = refined(problem, mesh, marked)
    assert finer.GetNE(ng.BND) == mesh.GetNE(ng.BND)
    assert mesh.ne < finer.ne < mesh.ne + 60  # what one element takes along: measured 26


def test_a_mesh_without_cad_stays_matched():
    x = np.linspace(-1, 1, 9)
    mesh = given = two_blocks(x, x)
    problem = pressed(given, BLOCKS, BOUNDED["blocks"].contact)
    for _ in range(3):
        mesh = refined(problem, mesh, near_tip(mesh, "lower_contact", 0.3))
    here, there = (np.sort(vertices(mesh, side)[:, 0]) for side in BOUNDED["blocks"].sides)
    assert np.diff(here).min() == 0.25 / 2**3
    assert here == pytest.approx(there, abs=ROUND_OFF)
