"""The mesh of the stress: its triangles fill the domain, with curved sides as without."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.reference import cases
from ngcontact.estimator.bound.cells import cells_of, dependent, parted, places
from ngcontact.fem import boundary_trace
from ngcontact.lagrange import gauss
from ngcontact.mesh import curve, first_mesh
from tests.given_meshes import mesh_of

NONE = np.zeros(0, dtype=np.intp)
NO_CUTS = NONE, np.zeros(0)


def square(n=2):
    """The unit square of 2 n^2 triangles."""
    ticks = np.linspace(0, 1, n + 1)
    return mesh_of([("body", ticks, ticks, ("bottom", "right", "top", "left"))])


def ring(order):
    """A quarter of a ring between the radii 1/2 and 1, of a degree; its trace."""
    case = cases.ring_in_bearing()
    mesh, _ = curve(first_mesh(case.problem, 0.3), order, "isoparametric")
    return boundary_trace(mesh, order)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_curved_triangles(order):
    """Area and moment are those of the domain of the mesh, by Green's formula on its boundary."""
    trace = ring(order)
    every = np.arange(len(trace.region))
    cells = cells_of(trace, NO_CUTS)
    cells, _ = parted(cells, dependent(cells, every, NONE))
    assert cells.curved.any() == (order > 1)
    t, w = gauss(24)
    segment, weight = np.repeat(every, len(t)), np.tile(w, len(every))
    x, dx = (f(segment, np.tile(t, len(every))) for f in (trace.point, trace.derivative))
    for function, primitive in (
        (lambda x: np.ones(len(x)), lambda x: x[:, 0]),
        (lambda x: x[:, 0] ** 2 * x[:, 1], lambda x: x[:, 0] ** 3 / 3 * x[:, 1]),
    ):
        found = 0.0
        for at in (np.flatnonzero(cells.curved), np.flatnonzero(~cells.curved)):
            if at.size:
                points = places(cells, at, 16)
                found += points.weight.ravel() @ function(points.x.reshape(-1, 2))
        expected = abs((weight * primitive(x) * dx[:, 1]).sum())
        assert found == pytest.approx(expected, rel=1e-11)
