"""What several test modules share."""

from __future__ import annotations

import numpy as np
import pytest

from drivers import cases
from ngcontact.check import boundary_mask
from ngcontact.trace import boundary_trace

REPRODUCED = {  # by order: cases whose solution lies in the space
    "constant pressure": (cases.pressure_patch, (1, 3)),
    "linear pressure": (lambda: cases.pressure_patch(p1=0.5), (2, 4)),
    "polygonal line": (cases.polygonal_patch, (1, 2)),
}


@pytest.fixture(
    params=[
        pytest.param((make, order), id=f"{name}, order {order}")
        for name, (make, orders) in REPRODUCED.items()
        for order in orders
    ]
)
def reproduced(request):
    """A case and an order at which its solution lies in the space."""
    make, order = request.param
    return make(), order


def coordinates(mesh):
    """Copy of all vertices; a view outlives no mesh."""
    return np.array(mesh.ngmesh.Coordinates())[:, :2]


def vertices(mesh, pattern):
    """Vertices (k, 2) of the boundaries of that name."""
    trace = boundary_trace(mesh, 1)
    numbers = np.unique(trace.nodes[trace.select(boundary_mask(mesh, pattern))])
    return coordinates(mesh)[numbers]
