"""Parents of refined vertices: kept by copies, also of meshes that were refined in place."""

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact.adaptivity import refined
from ngcontact.mesh.generation import first_mesh
from ngcontact.mesh.parents import copied, vertex_parents
from tests.scenes import coordinates, near_origin

BLOCK = cases.partly_opening_block()  # straight, nodes matched


def check_midpoints(mesh, old):
    """Vertices after the first `old` ones lie in the middle of their parents."""
    family, xy = vertex_parents(mesh), coordinates(mesh)
    assert len(family) == mesh.nv
    assert (family[:old] == -1).all()
    new = np.arange(old, mesh.nv)
    assert (family[new] >= 0).all()
    assert (family[new] < new[:, None]).all()
    # Round-off of coordinates of size 2.
    np.testing.assert_allclose(xy[new], xy[family[new]].mean(axis=1), rtol=0, atol=1e-15)


@pytest.mark.parametrize("local", [False, True])
def test_vertices_lie_between_their_parents(local):
    mesh = first = first_mesh(BLOCK, 0.5)
    for _ in range(3):
        mesh = refined(BLOCK, mesh, near_origin(mesh) if local else None)
    check_midpoints(mesh, first.nv)
    np.testing.assert_array_equal(vertex_parents(first), np.full((first.nv, 2), -1))


def test_what_refinement_in_place_knows_is_kept():
    mesh = ng.Mesh(first_mesh(BLOCK, 0.5).ngmesh.Copy())
    old = mesh.nv
    mesh.Refine()
    mesh.Refine()
    copy = copied(mesh)
    check_midpoints(copy, old)
    copy.Refine()
    check_midpoints(copy, old)
    check_midpoints(refined(BLOCK, copy), old)
