"""Sequences of loads on one mesh: what is taken over, and that it is right."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Elastic, Problem, solve
from ngcontact.mesh import first_mesh
from ngcontact.problem import MeshArrays, move_vertices
from tests.discrete.test_linear_systems import same

# Of other factorisations of one matrix, condition 1e4: two orders of round-off.
ROUND_OFF = 1e-11
STEEL = Elastic(E=200.0, nu=0.3)


def pressed(load: float = 1.0, **changes: object) -> Problem:
    """Blocks, the upper one held sideways only, under a pressure that grows to the right."""
    data = {
        "materials": {"upper": STEEL, "lower": STEEL},
        "sliding": "upper_left",
        "traction": {"top": load * (1.5 + ng.x)},
    }
    return replace(cases.touching_blocks({"bottom": (0, 0)}, **data), **changes)


E = ng.Parameter(200.0)
SOFT = {"upper": Elastic(E=E, nu=0.3), "lower": STEEL}
HELD = {"displacement": {"bottom": (0, 0), "top": (None, -0.01)}, "traction": {}}
SEQUENCES = {  # what changes, assemblies, factorisations if they do not depend on the first set
    "load": (pressed(), pressed(0.3, force={"upper": (0, -0.3)}), 0, 0),
    "law": (pressed(), pressed(materials={"upper": STEEL, "lower": Elastic(200.0, 0.2)}), 1, 1),
    "parameter": (pressed(materials=SOFT), pressed(materials=SOFT), 1, 1),
    "model": (pressed(), pressed(model="plane stress"), 1, 1),
    "support": (pressed(), pressed(**HELD), 0, 1),
    "guide": (pressed(), pressed(sliding="upper_right"), 0, None),
    "bilateral": (pressed(), pressed(contact=[replace(cases.TOUCHING, bilateral=True)]), 0, None),
}


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("name", SEQUENCES)
def test_what_a_solution_leaves_for_the_next(name, order):
    one, other, assemblies, factorizations = SEQUENCES[name]
    E.Set(200.0)
    first = solve(one, maxh=0.4, order=order)
    E.Set(20.0)
    second = solve(other, first.mesh, order=order, start=first)
    assert second.work["assemblies"] == assemblies
    assert factorizations in (None, second.work["factorizations"])
    assert second.work["gap_searches"] == 0
    same(second, solve(other, first.mesh, order=order), ROUND_OFF)


def test_a_mesh_whose_interior_moved_is_assembled_again():
    problem = cases.one_transition().problem
    mesh = first_mesh(problem, 0.3)
    first = solve(problem, mesh, order=2)
    view = MeshArrays(mesh)
    places, inner = view.vertices.copy(), np.setdiff1d(np.arange(mesh.nv), view.facets)
    places[inner] += 0.02  # a tenth of an element
    move_vertices(mesh, places)
    again, fresh = solve(problem, mesh, order=2, start=first), solve(problem, mesh, order=2)
    assert again.work["assemblies"] == 1
    u, v = (s.displacement.vec.FV().NumPy() for s in (again, fresh))
    # Factors for other first active sets: round-off times the condition, about 1e4.
    np.testing.assert_allclose(u, v, rtol=0, atol=1e-11 * np.abs(v).max())
