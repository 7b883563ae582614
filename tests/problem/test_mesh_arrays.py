"""NGSolve's mesh as arrays, places inside others, and checks about the axis of revolution."""

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured3DMesh

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries.region import compound
from ngcontact.problem import MeshArrays
from tests.scenes import rectangle


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


SOFT = Elastic(E=1.0, nu=0.3)


def problem(left=0.0, size=1.0, **changes):
    """A cylinder left < r < 1, 0 < z < 1, times `size`."""
    sides = ["bottom", "side", "top", "axis"]
    section = rectangle("body", (left * size, size), (0, size), sides)
    data = {"displacement": {"bottom": (None, 0)}, "traction": {"top": 1.0}}
    data |= {"materials": {"body": SOFT}, "model": "axisymmetric"}
    return Problem(compound(section), **data | changes)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"left": -0.2}, r"reaches to x = -.* across the axis x = 0: .* half with x >= 0"),
        ({"left": -2.0, "traction": {}}, r"across the axis"),
        ({"traction": {"axis": 1.0}}, 'traction "axis" is on the axis x = 0, which has no area'),
        ({"traction": {"top": (1.0, 0)}}, 'traction "top" has the radial component 1 .* sideways'),
        ({"force": {"body": (2.0, 0)}}, 'force "body" has the radial component 2 .* sideways'),
        (
            {"displacement": {"bottom": (0.5, 0)}},
            'displacement "bottom" has the radial component 0.5 .* sideways',
        ),
        ({"displacement": {"axis": (0, 0)}}, 'displacement "axis" is on the axis .* by None'),
        (
            {"contact": [Contact("axis", direction=(-1, 0), gap=0.1)]},
            'contact "axis" is on the axis x = 0, which has no area: name a boundary with x > 0',
        ),
    ],
)
def test_what_is_refused(changes, message, size):
    with pytest.raises(ValueError, match=message):
        solve(problem(size=size, **changes), maxh=size / 2)
