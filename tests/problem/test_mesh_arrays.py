"""NGSolve's mesh as arrays: against NGSolve's own elements."""

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured3DMesh

from ngcontact.geometries import disc_on_block
from ngcontact.problem import MeshArrays, bisect


@pytest.fixture(params=[1, 3], ids=["straight", "curved"])
def mesh(request):
    mesh = ng.Mesh(disc_on_block(radius=1.0).GenerateMesh(maxh=0.5))
    mesh.Curve(request.param)
    return mesh


def test_numbers_are_those_of_ngsolve(mesh):
    view = MeshArrays(mesh)
    for vb, vertices, regions in (
        (ng.VOL, view.elements, view.bodies),
        (ng.BND, view.facets, view.boundaries),
    ):
        elements = list(mesh.Elements(vb))
        assert vertices.tolist() == [[v.nr for v in el.vertices] for el in elements]
        assert regions.tolist() == [el.index for el in elements]
    assert view.vertices.tolist() == [list(v.point) for v in mesh.vertices]
    assert view.without_simplices() == 0


def test_arrays_of_tetrahedra():
    mesh = MakeStructured3DMesh(hexes=False, nx=2)
    view = MeshArrays(mesh)
    for vb, vertices in ((ng.VOL, view.elements), (ng.BND, view.facets)):
        assert np.sort(vertices).tolist() == [
            sorted(v.nr for v in el.vertices) for el in mesh.Elements(vb)
        ]
    corners = np.sort(view.elements[view.facet_elements])
    assert (corners[:, :, None] == view.facets[:, None]).any(axis=1).all()
    assert not view.inner_facets.any()
    assert view.diameters == pytest.approx(0.5 * 3**0.5)
    assert not view.pieces.any()
    _, count = np.unique(view.keys(view.sides), return_counts=True)
    assert np.count_nonzero(count == 1) == len(view.facets)


def test_only_marked_elements_are_bisected(mesh):
    """Apart from the closure: far from them nothing changes, nor do earlier marks count."""
    marked = np.zeros(mesh.ne, dtype=bool)
    marked[0] = True
    old = mesh.ne
    bisect(mesh, marked)
    once = mesh.ne - old
    assert 0 < once < old / 2
    bisect(mesh, np.zeros(mesh.ne, dtype=bool))
    assert mesh.ne == old + once
