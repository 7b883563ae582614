"""Sequences of loads on one mesh: what is taken over, and that it is right."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, Elastic, Problem, Solution, solve
from ngcontact.geometries import blocks
from ngcontact.mesh import first_mesh
from ngcontact.problem import Triangulation, move_vertices

STEEL = Elastic(E=200.0, nu=0.3)
PAIR = Contact(secondary="upper_contact", primary="lower_contact")


def pressed(load: float = 1.0, **changes: object) -> Problem:
    """Blocks, the upper one held sideways only, under a pressure that grows to the right."""
    problem = Problem(
        geometry=blocks(),
        materials={"upper": STEEL, "lower": STEEL},
        displacement={"bottom": (0, 0)},
        sliding="upper_left",
        traction={"top": load * (1.5 + ng.x)},
        contact=[PAIR],
    )
    return replace(problem, **changes)


def same(one: Solution, other: Solution) -> None:
    """Both solve the same discrete problem."""
    np.testing.assert_array_equal(one.active, other.active)
    u, v = (s.displacement.vec.FV().NumPy() for s in (one, other))
    # Two orders of round-off: other factorisations of one matrix, condition 1e4.
    np.testing.assert_allclose(u, v, rtol=0, atol=1e-11 * np.abs(v).max())


@pytest.mark.parametrize("order", [1, 3])
def test_another_load_costs_back_solves_only(order: int) -> None:
    first = solve(pressed(), maxh=0.4, order=order)
    for load in (2.0, 0.3, 1e-3):
        problem = pressed(load, force={"upper": (0, -load)})
        second = solve(problem, first.mesh, order=order, start=first)
        work = second.work
        assert (work["assemblies"], work["factorizations"], work["gap_searches"]) == (0, 0, 0)
        assert 0 < work["back_solves"] <= 20
        same(second, solve(problem, first.mesh, order=order))
    assert first.work["assemblies"] == first.work["factorizations"] == 1


def test_other_bodies_are_assembled() -> None:
    E = ng.Parameter(200.0)
    soft = {"upper": Elastic(E=E, nu=0.3), "lower": STEEL}
    first = solve(pressed(materials=soft), maxh=0.4)
    E.Set(20.0)
    for problem in (
        pressed(materials=soft),
        pressed(materials={"upper": STEEL, "lower": Elastic(E=200.0, nu=0.2)}),
        pressed(model="plane stress"),
    ):
        second = solve(problem, first.mesh, start=first)
        assert (second.work["assemblies"], second.work["factorizations"]) == (1, 1)
        same(second, solve(problem, first.mesh))


@pytest.mark.parametrize("order", [1, 3])
def test_other_supports_and_pairs_are_factorised(order: int) -> None:
    first = solve(pressed(), maxh=0.4, order=order)
    for problem in (
        pressed(displacement={"bottom": (0, 0), "upper_left": (0, None)}, sliding=None),
        pressed(displacement={"bottom": (0, 0), "top": (None, -0.01)}, traction={}),
        pressed(contact=[replace(PAIR, bilateral=True)]),
    ):
        second = solve(problem, first.mesh, order=order, start=first)
        assert second.work["assemblies"] == 0
        same(second, solve(problem, first.mesh, order=order))
    held = pressed(displacement={"bottom": (0, 0), "top": (None, -0.01)}, traction={})
    assert solve(held, first.mesh, order=order, start=first).work["factorizations"] == 1


def test_a_mesh_whose_interior_moved_is_assembled_again():
    problem = cases.one_transition().problem
    mesh = first_mesh(problem, 0.3)
    first = solve(problem, mesh, order=2)
    view = Triangulation(mesh)
    places, inner = view.vertices.copy(), np.setdiff1d(np.arange(mesh.nv), view.segments)
    places[inner] += 0.02  # a tenth of an element
    move_vertices(mesh, places)
    again, fresh = solve(problem, mesh, order=2, start=first), solve(problem, mesh, order=2)
    assert again.work["assemblies"] == 1
    u, v = (s.displacement.vec.FV().NumPy() for s in (again, fresh))
    # Factors for other first active sets: round-off times the condition, about 1e4.
    np.testing.assert_allclose(u, v, rtol=0, atol=1e-11 * np.abs(v).max())
