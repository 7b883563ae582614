"""Stresses in equilibrium with the loads, and what they prove about a discrete solution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, power_of_two
from ....fem import BoundaryTrace, shear_moduli
from ....problem import Problem, Triangulation
from .conditions import DATA_BONUS, EdgeConditions
from .elements import condensed, gathered, raw_operators, without_opposite
from .partition import Partition
from .patches import multipliers
from .polynomials import basis, dimension, lattice, triangle_rule
from .rigid_loads import exchanged_loads

AT_ONCE = 4_000_000  # numbers in the operators of elements that are made together


@dataclass(frozen=True)
class Units:
    """Powers of 2 by which all numbers are divided: a stress, a modulus and a length."""

    stress: float
    modulus: float
    length: float

    @property
    def strain(self) -> float:
        """The strain that belongs to stress and modulus."""
        return self.stress / self.modulus


@dataclass(frozen=True, eq=False)
class Discrete:
    """A discrete solution on n triangles, in units of its own.

    Attributes
    ----------
    partition : Partition
        The triangles.
    order : int
        Degree p of the displacement.
    law : ndarray (n, 3, 3)
        Moduli.
    root : ndarray (n, 3, 3)
        Their Cholesky factors.
    stress : ndarray (n, 3, m)
        (xx, yy, xy) of sigma_h, coefficients of polynomials of degree p - 1.
    force : ndarray (n, 3, 2, j)
        Hats times body forces, coefficients of polynomials of degree k - 1.
    missed : ndarray (n,)
        Norms of what polynomials of degree k - 1 miss of the body forces.
    """

    partition: Partition
    order: int
    law: Array
    root: Array
    stress: Array
    force: Array
    missed: Array

    @property
    def degree(self) -> int:
        """Degree k of the equilibrated stress."""
        return degree_for(self.order)


def degree_for(order: int) -> int:
    """Degree k of the equilibrated stress of displacements of degree `order`."""
    return max(3, order + 1)


def units_of(problem: Problem, boundary: BoundaryTrace, stress: ng.CoefficientFunction) -> Units:
    """Units of a solution."""
    mesh = boundary.mesh
    points = mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)
    return Units(
        stress=power_of_two(np.asarray(stress(points))),
        modulus=power_of_two(shear_moduli(problem, mesh)),
        length=power_of_two(np.ptp(Triangulation(mesh).vertices, axis=0)),
    )


def discrete_on(
    problem: Problem,
    partition: Partition,
    order: int,
    stress: ng.CoefficientFunction,
    units: Units,
) -> Discrete:
    """A discrete stress and its data on the triangles of a partition."""
    every, middle = np.arange(len(partition.triangles)), np.array([[1 / 3, 1 / 3]])
    law = np.zeros((len(every), 3, 3))
    region = Triangulation(partition.mesh).bodies[partition.parent]
    for pattern, material in problem.materials.items():
        at = _of_body(partition.mesh, pattern, region)
        C = material.voigt(problem.model)
        law[at] = partition.evaluate(C, at[:1], middle).reshape(-1, 3, 3) / units.modulus
    points = lattice(order - 1)
    xx, xy, _, yy = stress
    values = partition.evaluate(ng.CF((xx, yy, xy)).Compile(), every, points) / units.stress
    fit = basis(max(order - 1, 1)).values(points)[:, : dimension(order - 1)]
    coefficients = np.einsum("iq,nqc->nci", np.linalg.inv(fit), values)
    degree = degree_for(order)
    force = np.zeros((len(every), 3, 2, dimension(degree - 1)))
    missed = np.zeros(len(every))
    rule, weights = triangle_rule(2 * degree + DATA_BONUS)
    values = basis(degree - 1).values(rule)
    hats = np.column_stack([rule, 1 - rule.sum(axis=1)])
    for pattern, F in problem.force.items():  # (3.5)
        at = _of_body(partition.mesh, pattern, region)
        f = partition.evaluate(F, at, rule) * (units.length / units.stress)
        force[at] = np.einsum("q,qa,qi,nqc->naci", weights, hats, values, f, optimize=True)
        rest = f - np.einsum("qi,nci->nqc", values, force[at].sum(axis=1))
        missed[at] = np.sqrt(partition.areas[at] * np.einsum("q,nqc->n", weights, rest**2))
    return Discrete(
        partition=partition,
        order=order,
        law=law,
        root=np.asarray(np.linalg.cholesky(law)),
        stress=coefficients,
        force=force,
        missed=missed,
    )


def _of_body(mesh: ng.Mesh, pattern: str, region: Index) -> Index:
    """Triangles, of the `region` (n,), of the bodies that a pattern selects, (j,)."""
    return np.flatnonzero(np.array(mesh.Materials(pattern).Mask())[region])


@dataclass(frozen=True, eq=False)
class Equilibrated:
    """An equilibrated stress: its difference from the discrete one on n triangles.

    Attributes
    ----------
    change : ndarray (n, j)
        Coefficients, orthonormal in the energy.
    rest : float
        Forces on patches that stay unbalanced, relative to the largest.
    """

    change: Array
    rest: float


def _blocks(count: int, size: int) -> Iterator[Index]:
    step = max(1, AT_ONCE // size)
    for low in range(0, count, step):
        yield np.arange(low, min(low + step, count))


def _basis(discrete: Discrete, at: Index) -> tuple[Array, Array]:
    """Matrices (b, 3 n, 3 n) from orthonormal to raw coefficients of triangles `at` (b,)."""
    n = dimension(discrete.degree)
    size = np.sqrt(discrete.partition.areas[at])[:, None, None]
    root = discrete.root[at] / size
    eye = np.eye(n)
    into = np.einsum("bij,kl->bikjl", root, eye).reshape(len(at), 3 * n, 3 * n)
    return into, np.asarray(np.linalg.inv(root))


def _loads(discrete: Discrete, at: Index, theta: Array) -> tuple[Array, Array]:
    """Hats times sigma_h (b, 3, 3, m), and divergences (b, 3, 2, l) that are to be added to them.

    To coefficients in polynomials of degree p and k - 1, for each vertex.
    """
    partition, p = discrete.partition, discrete.order
    sigma = discrete.stress[at]
    hatted = np.einsum("aij,bcj->baci", basis(p).hats, sigma)
    rho = -discrete.force[at].copy()
    rho[..., :3] += theta[at]
    if p > 1:
        D = basis(p - 1).derivatives
        low = np.einsum("brd,rij,bcj->bdci", partition.inverses[at], D, sigma)
        divergence = np.stack([low[:, 0, 0] + low[:, 1, 2], low[:, 0, 2] + low[:, 1, 1]], axis=1)
        hat = np.einsum("aij,bcj->baci", basis(p - 1).hats, divergence)
        rho[..., : hat.shape[-1]] -= hat
    return hatted, rho


def patch_loads(discrete: Discrete) -> Array:
    """What the divergence of each patch's stress shall be, up to degree 1: (n, 3, 2, 3)."""
    sigma, gradients = discrete.stress, discrete.partition.hat_gradients
    xx, yy, xy = sigma[:, 0], sigma[:, 1], sigma[:, 2]
    gx, gy = gradients[:, :, 0, None], gradients[:, :, 1, None]
    load = np.stack(
        [gx * xx[:, None] + gy * xy[:, None], gx * xy[:, None] + gy * yy[:, None]], axis=2
    )
    result = -discrete.force[..., :3].copy()
    low = min(3, load.shape[-1])
    result[..., :low] += load[..., :low]
    return result


def equilibrated(discrete: Discrete, conditions: EdgeConditions, given: Array) -> Equilibrated:
    """The stress of all patches together.

    `given` (e, 2, r) are the tractions of the boundary and of contact, see `EdgeConditions`.
    """
    partition, k = discrete.partition, discrete.degree
    n, r = len(partition.triangles), 2 * (k + 1)
    stiffness = 1 / np.linalg.inv(discrete.law)[:, [0, 1], [0, 1]].max(axis=1)
    theta, rest = exchanged_loads(
        partition,
        patch_loads(discrete),
        given,
        conditions.frames,
        conditions.constrained,
        stiffness,
    )
    S, g = np.empty((n, 3, 2 * r, 2 * r)), np.empty((n, 3, 2 * r))
    X, x = np.empty((n, 3, r, 2 * r)), np.empty((n, 3, r))
    size = 9 * dimension(k) ** 2
    for at in _blocks(n, size):
        into, inverse = _basis(discrete, at)
        D, N = raw_operators(partition, at, k, conditions.frames)
        parts = condensed(D @ into, N @ into)
        hatted, rho = _loads(discrete, at, theta)
        c = np.zeros((len(at), 3, 3, dimension(k)))
        c[..., : hatted.shape[-1]] = np.einsum("bij,bajl->bail", inverse, hatted)
        c = c.reshape(len(at), 3, -1) + parts.with_divergence(rho.reshape(len(at), 3, -1))
        t = c @ parts.N.transpose(0, 2, 1)
        S[at], g[at], X[at], x[at] = without_opposite(parts.G, t)
    lam = multipliers(partition, S, g, conditions.constrained, given)
    change = np.empty((n, 3 * dimension(k)))
    for at in _blocks(n, size):
        into, _ = _basis(discrete, at)
        D, N = raw_operators(partition, at, k, conditions.frames)
        parts = condensed(D @ into, N @ into)
        _, rho = _loads(discrete, at, 0 * theta)
        y = gathered(lam[at], X[at], x[at])
        change[at] = parts.with_divergence(rho.sum(axis=1).reshape(len(at), 1, -1))[:, 0]
        change[at] -= (parts.K @ y[:, :, None])[:, :, 0]
    return Equilibrated(change, rest)
