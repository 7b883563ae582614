"""Displacements that correct what u_h misses on the boundary: their energies by hand."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from drivers.reference.westergaard import moduli
from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.estimator.bound.cells import cells_of
from ngcontact.estimator.bound.facing import DATA_DEGREE
from ngcontact.estimator.bound.lifting import Prescribed, lifted
from ngcontact.fem import boundary_trace
from ngcontact.lagrange import gauss_lobatto
from tests.estimator.bound.test_cells import NO_CUTS, square

LAW = Elastic(E=2.5, nu=0.3)
SIDES = ("bottom", "right", "top", "left")
T = gauss_lobatto(DATA_DEGREE)  # where amounts are given


def asked_of(cells, name, direction, amount):
    """A component of a displacement of (x, y) on a boundary."""
    side = np.flatnonzero(np.isin(cells.segment, cells.trace.segments(name)))
    x, _ = cells.points(np.repeat(side, len(T)), np.tile(T, len(side)))
    d = np.broadcast_to(np.asarray(direction, dtype=float), (len(side), len(T), 2))
    return Prescribed(side, d, amount(*x.T).reshape(len(side), len(T)))


def whole(cells, u, v):
    """Both components on all sides."""
    return [asked_of(cells, name, d, f) for name in SIDES for d, f in (((1, 0), u), ((0, 1), v))]


def parts_of_power(x, y, n):
    """Real and negative imaginary part of (x + i y)^n."""
    a, b = 1.0, 0.0
    for _ in range(n):
        a, b = a * x - b * y, a * y + b * x
    return a, -b


def of_least_energy(u, v, degree, degree_on_sides):
    """|w|^2 by NGSolve, whose functions of edges are the same polynomials."""
    mesh, law = square(1), moduli(LAW)
    one = ng.H1(mesh, order=degree, dirichlet=".*")
    for edge in {edge.nr for element in mesh.Elements(ng.BND) for edge in element.edges}:
        one.SetOrder(ng.NodeId(ng.EDGE, edge), degree_on_sides)
    one.UpdateDofTables()
    space = one * one
    (a, b), (c, d) = space.TnT()
    e, f = (
        [ng.grad(x)[0], ng.grad(y)[1], ng.grad(x)[1] + ng.grad(y)[0]] for x, y in ((a, b), (c, d))
    )
    stress = 2 * law.mu * (e[0] * f[0] + e[1] * f[1] + e[2] * f[2] / 2)
    form = ng.BilinearForm(space)
    form += (stress + law.lam * (e[0] + e[1]) * (f[0] + f[1])) * ng.dx(bonus_intorder=20)
    matrix, w = form.Assemble().mat, ng.GridFunction(space)
    for part, given in zip(w.components, (u, v), strict=True):
        part.Set(given(ng.x, ng.y), ng.BND, bonus_intorder=20)
    w.vec.data -= matrix.Inverse(space.FreeDofs()) @ matrix * w.vec
    return ng.InnerProduct(w.vec, matrix * w.vec)


@pytest.mark.parametrize(("n", "degree"), [(3, 4), (4, 5), (6, 4), (8, 2)])
def test_the_field_of_least_energy(n, degree):
    """Conjugates of (x + i y)^n are gradients of harmonic polynomials: they need no forces."""
    mesh = square(1)
    problem = Problem(mesh, {"body": LAW}, displacement={"|".join(SIDES): (0, 0)})
    cells = cells_of(boundary_trace(mesh, 1), NO_CUTS)
    u, v = (lambda x, y, k=k: parts_of_power(x, y, n)[k] for k in (0, 1))
    # e = n ((x + i y)^(n-1)): 2 mu e : e = 4 mu n^2 |z|^(2 n - 2).
    t, w = np.polynomial.legendre.leggauss(2 * n)
    X, Y = np.meshgrid((1 + t) / 2, (1 + t) / 2)
    r = np.outer(w, w) / 4 * (X**2 + Y**2) ** (n - 1)
    exact = 4 * moduli(LAW).mu * n**2 * r.sum()
    if degree < n:  # what is no polynomial of the degree is one of a higher degree on sides
        exact = of_least_energy(u, v, degree, n)
    norms = lifted(problem, cells, whole(cells, u, v), [], degree, 1.0)
    assert (norms**2).sum() == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("gap", [0.0, 0.02 * ng.x])
def test_contact_with_an_obstacle_beside_a_support(gap):
    """Nothing is lifted at the vertex of both, which does not move."""
    problem = Problem(
        geometry=square(4),
        materials={"body": LAW},
        displacement={"left": (0, 0)},
        traction={"top": (0, -0.1)},
        contact=[Contact("bottom", direction=(0, -1), gap=gap)],
    )
    coarse, fine = (solve(problem, order=order) for order in (1, 3))
    assert fine.error_bound < 0.5 * coarse.error_bound  # measured 0.3
    low, high = zip(coarse.energy_bounds, fine.energy_bounds, strict=True)
    assert max(low) <= min(high)


def test_supports_that_elements_do_not_meet():
    """u_D - u_h is lifted: none of polynomials of the order, some of others."""
    base = cases.one_transition().problem
    parts = []
    for f in (ng.x**2, ng.sin(3 * ng.x)):
        problem = replace(base, displacement={"bottom": (0, 0), "top": (0, -0.01 * (2 + f))})
        parts.append(solve(problem, maxh=0.5, order=2).bound_parts["lifting"])
    assert parts[0] <= 1e-15 * parts[1]
