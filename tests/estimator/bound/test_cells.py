"""The mesh of the stress: its sizes, its boundary, where it is cut."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, solve
from ngcontact.estimator.bound.cells import bisected, cells_of, dependent, parted, places
from ngcontact.estimator.bound.facing import facing_middles, pressure_support
from ngcontact.fem import boundary_trace
from ngcontact.geometries import rings
from ngcontact.mesh import curve, first_mesh
from tests.given_meshes import mesh_of, two_blocks
from tests.scenes import unmatched_blocks

NONE = np.zeros(0, dtype=np.intp)
NO_CUTS = NONE, np.zeros(0)
ROUND_OFF = 1e-12


def square(n=2):
    """The unit square of 2 n^2 triangles."""
    ticks = np.linspace(0, 1, n + 1)
    return mesh_of([("body", ticks, ticks, ("bottom", "right", "top", "left"))])


def ring(order):
    """A quarter of a ring between the radii 1/2 and 1, of a degree; its trace."""
    case = cases.ring_in_bearing()
    mesh, _ = curve(first_mesh(case.problem, 0.3), order, "isoparametric")
    return boundary_trace(mesh, order)


def divided(trace, loaded, held):
    """Cells without triangles that are `dependent`."""
    cells = cells_of(trace, NO_CUTS)
    return parted(cells, dependent(cells, loaded, held))[0]


def moment(cells, function, order=8):
    """Integral of a function of (k, 2) over all triangles."""
    total = 0.0
    for at in (np.flatnonzero(cells.curved), np.flatnonzero(~cells.curved)):
        if at.size:
            points = places(cells, at, order)
            total += (points.weight * function(points.x.reshape(-1, 2)).reshape(len(at), -1)).sum()
    return total


def consistent(cells):
    """Sides know their vertices, owners, and places on the boundary."""
    start, stop = np.roll(cells.triangles, -1, axis=1), np.roll(cells.triangles, -2, axis=1)
    np.testing.assert_array_equal(cells.ends[cells.sides, 0], np.minimum(start, stop))
    np.testing.assert_array_equal(cells.ends[cells.sides, 1], np.maximum(start, stop))
    owned = cells.sides[cells.owner, cells.local]
    np.testing.assert_array_equal(owned, np.arange(len(cells.ends)))
    edges = cells.corners[:, 1:] - cells.corners[:, :1]
    assert (np.linalg.det(edges) > 0).all()
    border = np.flatnonzero(cells.segment >= 0)
    assert not cells.inner[border].any()
    for t in (0.0, 1.0):
        segment, s = cells.on_side(border, np.full(len(border), t))
        at = cells.vertices[cells.ends[border, int(t)]]
        np.testing.assert_allclose(cells.trace.point(segment, s), at, atol=ROUND_OFF)
    spans = np.bincount(cells.segment[border], np.abs(np.diff(cells.span[border], axis=1))[:, 0])
    outer = np.flatnonzero(~cells.trace.inner)
    np.testing.assert_allclose(spans[outer], 1.0, rtol=ROUND_OFF)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_curved_triangles(order):
    """Area and moment are those of the domain of the mesh, by Green's formula on its boundary."""
    trace = ring(order)
    cells = divided(trace, np.arange(len(trace.region)), NONE)
    consistent(cells)
    assert cells.curved.any() == (order > 1)
    t, w = (
        (np.polynomial.legendre.leggauss(12)[0] + 1) / 2,
        np.polynomial.legendre.leggauss(12)[1] / 2,
    )
    segment = np.repeat(np.arange(len(trace.region)), len(t))
    x, dx = (f(segment, np.tile(t, len(trace.region))) for f in (trace.point, trace.derivative))
    weight = np.tile(w, len(trace.region))
    for function, primitive in (
        (lambda x: np.ones(len(x)), lambda x: x[:, 0]),
        (lambda x: x[:, 0] ** 2 * x[:, 1], lambda x: x[:, 0] ** 3 / 3 * x[:, 1]),
    ):
        expected = abs((weight * primitive(x) * dx[:, 1]).sum())
        assert moment(cells, function, 16) == pytest.approx(expected, rel=1e-11)


@cache
def pressed(kind):
    """Solutions with cells on which bodies face each other."""
    problem = cases.one_transition().problem
    if kind == "dual rows":
        return solve(replace(problem, geometry=unmatched_blocks()), maxh=0.5, order=2)
    if kind == "imported":
        mesh = two_blocks(np.linspace(-1, 1, 6), np.linspace(-1, 1, 8))
        pair = Contact("upper_contact", "lower_contact")
        return solve(replace(problem, geometry=mesh, contact=[pair]), order=2)
    if kind == "rings":
        problem = cases.ring_in_ring().problem
        return solve(replace(problem, geometry=rings(quarter=True)), maxh=0.4, order=2)
    return solve(cases.hertz_contact().problem, maxh=0.25, order=2)


@pytest.mark.parametrize("kind", ["dual rows", "imported", "rings", "Hertz"])
def test_sides_that_face_are_one_to_one(kind):
    """Each meets one side of the other body from end to end; jumps lie at places of the gap."""
    proof = pressed(kind).equilibrated.proof
    cells = proof.dual.cells
    consistent(cells)
    (facing,) = (line for line in proof.dual.program.lines if line.pair is not None)
    assert len(facing.side) > 0
    assert len(np.unique(facing.other)) == len(facing.side)
    first, last = np.sort(facing.there[:, [0, -1]], axis=1).T
    t = np.polynomial.legendre.leggauss(facing.there.shape[1])[0]
    edge = (1 + t[0]) / 2  # the first of the points in (0, 1)
    np.testing.assert_allclose(first, edge, atol=0.1 * edge)
    np.testing.assert_allclose(1 - last, edge, atol=0.1 * edge)
    own = cells.points(facing.side, np.full(len(facing.side), 0.5))[0]
    other = cells.points(facing.other, np.full(len(facing.side), 0.5))[0]
    lengths = np.linalg.norm(np.diff(cells.vertices[cells.ends[facing.side]], axis=1)[:, 0], axis=1)
    assert (np.linalg.norm(own - other, axis=1) <= 0.1 * lengths).all()


@pytest.mark.parametrize("kind", ["dual rows", "rings"])
def test_bisected_cells(kind):
    """Sides face one to one; no angle is less than half of the smallest one (Rivara 1984)."""
    solution = pressed(kind)
    cells, u = solution.equilibrated.proof.dual.cells, solution.displacement
    supports = [pressure_support(cells.trace, u, pair, 5) for pair in solution.pairs]
    area, least = moment(cells, lambda x: np.ones(len(x))), angles(cells).min()
    largest = cells.diameters.max() / 4
    while (marked := cells.diameters > largest).any():
        cells, _ = bisected(cells, marked, lambda cells: facing_middles(cells, u, supports))
    consistent(cells)
    assert moment(cells, lambda x: np.ones(len(x))) == pytest.approx(area, rel=ROUND_OFF)
    assert angles(cells).min() >= least / 2 or kind == "rings"  # curves change angles
    side, other, there = facing_middles(cells, u, supports)
    assert len(np.unique(other)) == len(side)
    np.testing.assert_allclose(there, 0.5, atol=0.05)
    ends = np.sort(cells.vertices[cells.ends], axis=1)
    length = np.linalg.norm(ends[side, 1] - ends[side, 0], axis=1)
    away = np.linalg.norm(ends[side] - ends[other], axis=2).max(axis=1)
    assert (away <= 0.1 * length).all()


def angles(cells):
    """Of all triangles, (n, 3)."""
    x = cells.corners
    one, two = np.roll(x, 1, axis=1) - x, np.roll(x, 2, axis=1) - x
    product = (one * two).sum(axis=2)
    return np.arccos(product / np.linalg.norm(one, axis=2) / np.linalg.norm(two, axis=2))


def test_a_vertex_where_contact_ends():
    """Of Hertz contact, within a tenth of a segment of the exact end."""
    cells = pressed("Hertz").equilibrated.proof.dual.cells
    cut = np.flatnonzero((cells.segment >= 0) & (np.abs(np.diff(cells.span, axis=1))[:, 0] < 1))
    ends = np.unique(np.abs(cells.vertices[cells.ends[cut]][:, :, 0]))
    length = 2 / len(cells.trace.segments("lower_contact"))
    assert np.abs(ends - 0.3).min() <= 0.1 * length
