"""Which elements contain points: against images of known places, sides, sizes of all kinds."""

import ngsolve as ng
import numpy as np
import pytest

from ngcontact.adaptivity import refined
from ngcontact.fem import boundary_trace
from ngcontact.mesh import curve, first_mesh
from ngcontact.quadrature import mesh_points
from ngcontact.results import locate
from tests.scenes import REFINED, near_origin


def graded(order):
    """A mesh of the disc on the block whose elements differ by a factor of a hundred in size."""
    problem = REFINED["disc on block"]
    mesh = first_mesh(problem, 0.5)
    for k in range(7):
        mesh = refined(problem, mesh, near_origin(mesh, 2.0**-k))
    return curve(mesh, order, "isoparametric")[0]


@pytest.mark.parametrize("order", [1, 2, 4])
def test_images_of_places_in_elements_are_found_there(order):
    mesh = graded(order)
    trace = boundary_trace(mesh, order)
    element = np.repeat(np.arange(mesh.ne), 3)
    inner = np.array([[0.2, 0.3], [0.02, 0.9], [1 / 3, 1 / 3]])
    reference = np.tile(inner, (mesh.ne, 1))
    at = mesh_points(mesh, element, reference[:, None]).ravel()
    found = locate(trace, np.asarray(ng.CF((ng.x, ng.y))(at)))
    # Points near an arc may lie in the disc and, of matched chords, in nothing else.
    np.testing.assert_array_equal(found.point, np.arange(len(element)))
    np.testing.assert_array_equal(found.element, element)
    np.testing.assert_allclose(found.reference, reference, atol=1e-11)
