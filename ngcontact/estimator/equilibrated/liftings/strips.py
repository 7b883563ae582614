"""Liftings of least energy into the strip of elements along the boundary.

In one triangle a polynomial that is given on an edge and 0 on the others cannot be nearly without
divergence, and a nearly incompressible body pays for it with its bulk modulus. On all elements
that touch the edges a continuous displacement of higher degree can: the least of them is found.
"""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace, edge_bubbles, model_of
from ....lagrange import gauss_lobatto
from ....linalg import inverse_of
from ....problem import Problem, Triangulation, varies
from ..data import Discrete, EdgeConditions, Units, legendre_values, triangle_rule
from .edges import EdgeField, norms

RICHER = 3  # degrees above that of the discrete displacement
LAW_BONUS = 8  # quadrature order above that of polynomials, for laws that vary and curves


def strip_norms(
    problem: Problem,
    boundary: BoundaryTrace,
    conditions: EdgeConditions,
    discrete: Discrete,
    fields: Sequence[EdgeField],
    moves: Array,
    units: Units,
) -> Array:
    """Energy norms (ne,) on each element of a displacement that is `fields` on their segments.

    With the displacements `moves` (nv, 2) of the vertices beneath, and 0 in what else is given on
    Gamma_u, Gamma_0 and Gamma_K.
    """
    q, mesh = boundary.order + RICHER, boundary.mesh
    space = ng.VectorH1(mesh, order=q)
    scalar = space.components[0]
    w = ng.GridFunction(space)
    values = w.vec.FV().NumPy().reshape(2, -1)
    bubbles = np.linalg.inv(edge_bubbles(scalar))
    numbers = np.array([scalar.GetDofNrs(el.edges[0]) for el in mesh.Elements(ng.BND)])
    nodes = legendre_values(q, gauss_lobatto(q)[1:-1])
    partition, total = discrete.partition, np.zeros(mesh.ne)
    touched, view = (moves != 0).any(axis=1), Triangulation(mesh)
    values[:, : mesh.nv] += moves.T
    for field in fields:
        c, rest = _split(field, q)
        values[:, numbers[partition.segment[field.edge]]] += np.einsum(
            "ij,jl,klc->cki", bubbles, nodes, c
        )
        element = partition.parent[partition.owner[0][field.edge]]
        np.add.at(total, element, norms(discrete, rest))
        moved = np.abs(c).max(axis=(1, 2), initial=0.0) > 0
        touched[boundary.nodes[partition.segment[field.edge[moved]]][:, [0, -1]]] = True
    strip: Mask = np.any(touched[view.triangles], axis=1, keepdims=True)[:, 0]
    if not strip.any():
        return total
    given = _given(problem, boundary, conditions, discrete)
    fixed = np.zeros(values.shape, dtype=bool)
    for number, el in enumerate(mesh.Elements(ng.BND)):
        fixed[np.ix_(given[number], scalar.GetDofNrs(el))] = True
    for el in mesh.Elements(ng.VOL):
        if not strip[el.nr]:
            fixed[:, scalar.GetDofNrs(el)] = True
    _relax(problem, space, w, ng.BitArray(strip), ng.BitArray(~fixed.ravel()))
    at = np.flatnonzero(strip[partition.parent])
    squares = _norms_on(problem, discrete, at, w, q, units) ** 2
    return total + np.sqrt(np.bincount(partition.parent[at], squares, minlength=mesh.ne))


def _split(field: EdgeField, degree: int) -> tuple[Array, EdgeField]:
    """Legendre coefficients (k, d + 1, 2) of polynomials near to a field, and what they miss."""
    at = legendre_values(degree, field.t.ravel()).reshape(*field.t.shape, -1)
    slopes = np.einsum("kq,kqi,kqc->kic", field.weight, at[..., :-1], field.slope)
    slopes[:, 0] = 0.0  # both ends are kept
    integral = np.zeros((degree + 1, degree))
    size = np.sqrt(2 * np.arange(degree + 1) + 1)
    for j in range(1, degree):
        integral[: j + 2, j] = legendre.legint(np.eye(degree)[j, : j + 1], lbnd=-1) / 2
    c = np.einsum("ij,kjc->kic", integral / size[:, None] * size[:degree], slopes)
    rest = EdgeField(
        edge=field.edge,
        t=field.t,
        weight=field.weight,
        value=field.value - np.einsum("kqi,kic->kqc", at, c),
        slope=field.slope - np.einsum("kqi,kic->kqc", at[..., :-1], slopes),
    )
    return c, rest


def _given(
    problem: Problem, boundary: BoundaryTrace, conditions: EdgeConditions, discrete: Discrete
) -> Mask:
    """Components (k, 2) of displacements that are given on the segments of the boundary."""
    given = np.zeros((len(boundary.region), 2), dtype=bool)
    outer: Index = np.flatnonzero(~boundary.inner)
    edge = discrete.partition.edge_of_segment[outer]
    free = ~conditions.constrained[edge].reshape(len(edge), 2, -1)[:, :, 0]
    given[outer] = free
    sides = [side for pair in problem.contact for side in (pair.secondary, pair.primary)]
    if problem.sliding is not None:
        sides.append(str(problem.sliding))
    given[boundary.segments(*sides)] = True
    return given


def _relax(
    problem: Problem, space: ng.FESpace, w: ng.GridFunction, strip: ng.BitArray, free: ng.BitArray
) -> None:
    """Let the `free` unknowns of `w` have the least energy on the elements of a `strip`."""
    u, v = space.TnT()
    model, a = model_of(problem), ng.BilinearForm(space, symmetric=True)
    for body, law in problem.materials.items():
        region = space.mesh.Materials(body)
        for work in model.work(law.voigt(problem.model), u, v):
            a += work * ng.dx(definedon=region, definedonelements=strip)
    a.Assemble()
    residual = w.vec.CreateVector()
    residual.data = a.mat * w.vec
    w.vec.data -= inverse_of(a.mat, free) * residual


def _norms_on(
    problem: Problem,
    discrete: Discrete,
    at: Index,
    w: ng.GridFunction,
    degree: int,
    units: Units,
) -> Array:
    """Energy norms (b,) of a displacement on triangles `at` (b,), over the unit of energy."""
    partition, order = discrete.partition, 2 * degree
    if discrete.rough is not None:
        order += 2 * (discrete.geometry - 1) + LAW_BONUS
    rule, weights = triangle_rule(order)
    e = partition.evaluate(model_of(problem).strain(w), at, rule) * partition.length
    if any(varies(law) for law in problem.materials.values()):
        laws = {body: law.voigt(problem.model) for body, law in problem.materials.items()}
        C = partition.evaluate(partition.mesh.MaterialCF(laws), at, rule) / units.modulus
        C = C.reshape(*e.shape, -1)
    else:
        C = discrete.law[at][:, None]
    weight = weights * np.linalg.det(partition.jacobians(at, rule)) / 2
    weight = weight * discrete.balance.measure(partition.places(at, rule))
    energy = np.einsum("bqi,bqij,bqj->bq", e, np.broadcast_to(C, (*e.shape, e.shape[2])), e)
    return np.sqrt((weight * energy).sum(axis=1))
