"""Triangles without closed forms: curved ones, and those of laws that vary.

There stresses are polynomials in x, too, of which norms and moments are integrated in points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from .....arrays import Array, Index
from .....problem import Problem
from ..partition import Partition
from ..polynomials import dimension, triangle_rule
from .places import places_in

LAW_BONUS = 8  # quadrature order above that of polynomials, for laws that vary
MANDEL = {3: np.sqrt([1.0, 1.0, 2.0]), 4: np.sqrt([1.0, 1.0, 1.0, 2.0])}  # by Voigt components
AT_ONCE = 2_000_000  # values of polynomials at quadrature points that are looked at together


@dataclass(frozen=True, eq=False)
class Rough:
    """Rough triangles, r of n; 3 j stresses, m polynomials of degree k - 1.

    Attributes
    ----------
    at : ndarray of int (r,)
        Their numbers.
    number : ndarray of int (n,)
        Which of them a triangle is, or -1.
    into : ndarray (r, 3 j, 3 j)
        From coefficients orthonormal in the energy to those of polynomials in x.
    hatted : ndarray (r, 3, 3 j)
        Orthonormal coefficients of the hats times sigma_h.
    divergence : ndarray (r, 3, 2, m)
        What the divergence of the stress of each patch shall be, less rigid loads.
    force, force_means : ndarray (r, 2, m)
        Projected body forces, and their means over the straight area times polynomials.
    moments : ndarray (r, 3, 2, 3)
        Means over the triangle's straight area of `divergence` times polynomials of degree 1.
    around : ndarray (r, 3, 3 j)
        Orthonormal coefficients of the hoop stress that balances radial loads of degree 1; 0 in the
        plane, where others do.
    gram : ndarray (r, 3, 3)
        The same of products of these polynomials.
    rest : ndarray (r,)
        Norms of what polynomials miss of sigma_h.
    missed : ndarray (r,)
        Norms of what they miss of the forces.
    distortion : ndarray (r,)
        Factor of Poincare's constant of the straight triangle.
    least, most : ndarray (r,)
        Smallest eigenvalue of the law in Mandel's scaling, and its largest ratio to the law of the
        middle.
    """

    at: Index
    number: Index
    into: Array
    hatted: Array
    divergence: Array
    force: Array
    force_means: Array
    moments: Array
    around: Array
    gram: Array
    rest: Array
    missed: Array
    distortion: Array
    least: Array
    most: Array

    def with_load(self, number: Index, load: Array) -> Rough:
        """With a `load` (j, 2, 3) of degree 1 in addition in those of `number` (j,)."""
        divergence, force = self.divergence.copy(), self.force.copy()
        moments, means = self.moments.copy(), self.force_means.copy()
        moment = np.einsum("jpq,jcq->jcp", self.gram[number], load)
        divergence[number, ..., :3] -= load[:, None] / 3
        moments[number] -= moment[:, None] / 3
        force[number, :, :3] += load
        means[number, :, :3] += moment
        return replace(self, divergence=divergence, force=force, moments=moments, force_means=means)


def blank(at: Index, number: Index, n: int, m: int) -> Rough:
    """Triangles `at` (r,), of `number` (t,), of which nothing is known yet."""
    r = len(at)
    return Rough(
        at=at,
        number=number,
        into=np.empty((r, 3 * n, 3 * n)),
        hatted=np.empty((r, 3, 3 * n)),
        divergence=np.zeros((r, 3, 2, m)),
        force=np.zeros((r, 2, m)),
        force_means=np.zeros((r, 2, m)),
        moments=np.zeros((r, 3, 2, 3)),
        around=np.zeros((r, 3, 3 * n)),
        gram=np.empty((r, 3, 3)),
        rest=np.empty(r),
        missed=np.empty(r),
        distortion=np.empty(r),
        least=np.empty(r),
        most=np.empty(r),
    )


def sampling_order(degree: int, geometry: int) -> int:
    """Order of the quadrature on rough triangles: exact for products of stresses on curves."""
    return 2 * degree * geometry + 2 * (geometry - 1) + LAW_BONUS


def rough_triangles(
    problem: Problem,
    partition: Partition,
    at: Index,
    geometry: int,
    degree: int,
    stress: ng.CoefficientFunction,
    law: Array,
    units: tuple[float, float],
) -> Rough:
    """Look at the triangles `at` (r,) in points.

    Parameters
    ----------
    problem, partition, stress
        The problem, all triangles, and (xx, yy, xy) of sigma_h.
    at : ndarray of int (r,)
        The rough triangles.
    geometry, degree : int
        Degree of curves and of stresses.
    law : ndarray (n, 3, 3)
        Moduli in the middle of all triangles.
    units : tuple of float
        Of stress and modulus.
    """
    n, m, r = dimension(degree), dimension(degree - 1), len(at)
    order = sampling_order(degree, geometry)
    number = np.full(len(partition.triangles), -1)
    number[at] = np.arange(r)
    result = blank(at, number, n, m)
    moduli = partition.mesh.MaterialCF(
        {name: body.voigt(problem.model) for name, body in problem.materials.items()}
    )
    force = partition.mesh.MaterialCF(problem.force, default=ng.CF((0, 0)))
    step = max(1, AT_ONCE // (len(triangle_rule(order)[1]) * 3 * n))
    for low in range(0, r, step):
        part = slice(low, min(low + step, r))
        _look(result, part, partition, order, degree, (moduli, stress, force), law, units)
    return result


def _look(
    result: Rough,
    part: slice,
    partition: Partition,
    order: int,
    degree: int,
    functions: tuple[ng.CoefficientFunction, ng.CoefficientFunction, ng.CoefficientFunction],
    law: Array,
    units: tuple[float, float],
) -> None:
    """Fill in a part of the triangles."""
    at, m = result.at[part], dimension(degree - 1)
    rule, _ = triangle_rule(order)
    points = places_in(partition, at, triangle_rule(order), degree)
    C, sigma, F = (partition.evaluate(f, at, rule) for f in functions)
    C, sigma = C.reshape(*C.shape[:2], 3, 3) / units[1], sigma / units[0]
    F = F * (partition.length / units[0])
    w, phi, area = points.weight, points.values, partition.areas[at]
    S = np.linalg.inv(C)
    b, n = len(at), phi.shape[2]
    weighted = (w * area[:, None])[:, :, None, None] * S
    gram = np.einsum("bqxy,bqi,bqj->bxiyj", weighted, phi, phi, optimize=True)
    lower = np.linalg.cholesky(gram.reshape(b, 3 * n, 3 * n))
    into = np.linalg.inv(lower).transpose(0, 2, 1)
    target = np.einsum("bqxy,bqy,qa,bqi->baxi", weighted, sigma, points.hats, phi, optimize=True)
    hatted = target.reshape(b, 3, -1) @ into
    result.into[part], result.hatted[part] = into, hatted
    raw = (into @ hatted.sum(axis=1)[:, :, None]).reshape(b, 3, n)
    off = sigma - np.einsum("bxi,bqi->bqx", raw, phi)
    result.rest[part] = np.sqrt(np.einsum("bqx,bqxy,bqy->b", off, weighted, off, optimize=True))
    low = phi[:, :, :m]
    gx, gy = points.gradients[..., 0], points.gradients[..., 1]  # (b, q, 3)
    xx, yy, xy = sigma[..., 0, None], sigma[..., 1, None], sigma[..., 2, None]
    gradient = np.stack([gx * xx + gy * xy, gx * xy + gy * yy], axis=-1)  # (b, q, 3, 2)
    d = gradient - points.hats[:, :, None] * F[:, :, None, :]
    moments = np.einsum("bq,bqac,bqi->baci", w, d, low, optimize=True)
    of_force = np.einsum("bq,bqc,bqi->bci", w, F, low, optimize=True)
    mass = np.einsum("bq,bqi,bqj->bij", w, low, low, optimize=True)
    inverse = np.linalg.inv(mass)
    result.divergence[part] = moments @ inverse[:, None]
    result.force[part], result.force_means[part] = of_force @ inverse, of_force
    result.moments[part] = moments[..., :3]
    result.gram[part] = mass[:, :3, :3]
    off_force = F - np.einsum("bci,bqi->bqc", result.force[part], low)
    result.missed[part] = np.sqrt(area * np.einsum("bq,bqc->b", w, off_force**2))
    result.distortion[part] = points.distortion
    mandel = MANDEL[3]
    result.least[part] = np.linalg.eigvalsh(C * mandel[:, None] * mandel)[..., 0].min(axis=1)
    half = np.linalg.inv(np.linalg.cholesky(law[at]))[:, None]
    ratio = np.linalg.eigvalsh(half @ C @ half.transpose(0, 1, 3, 2))[..., -1]
    result.most[part] = ratio.max(axis=1)
