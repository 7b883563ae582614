"""Triangles of a meridian section: polynomials for T = 2 pi r s, norms over the body.

The hoop stress is what `balance` says of T. All triangles are looked at in points, as T / r and
u_r / r are no polynomials; at a vertex on the axis points lie along rays from there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import ngsolve as ng
import numpy as np

from .....arrays import Array, Index
from .....lagrange import gauss
from .....problem import Problem
from ..balance import ABOUT_AXIS, ROUND_OFF
from ..partition import Partition
from ..polynomials import CORNERS, basis, dimension, triangle_rule
from .places import Places, places_in
from .rough import MANDEL, Rough, blank

POINTS_BONUS = 8  # quadrature order above that of polynomials, for laws, loads and divisions by r
AT_ONCE = 4_000_000  # values of stresses at quadrature points that are looked at together


def meridian_triangles(
    problem: Problem,
    partition: Partition,
    geometry: int,
    degree: int,
    voigt: ng.CoefficientFunction,
    law: Array,
    units: tuple[float, float],
) -> Rough:
    """Look at all n triangles in points.

    Parameters
    ----------
    problem, partition
        The problem, the triangles.
    geometry, degree : int
        Degree of curves and of stresses.
    voigt : CoefficientFunction
        (rr, zz, hoop, rz) of sigma_h.
    law : ndarray (n, 4, 4)
        Moduli in the middle of the triangles.
    units : tuple of float
        Of stress and modulus.
    """
    every = np.arange(len(partition.triangles))
    result = blank(every, every, dimension(degree), dimension(degree - 1))
    mesh = partition.mesh
    moduli = mesh.MaterialCF(
        {name: body.voigt(problem.model) for name, body in problem.materials.items()}
    )
    force = mesh.MaterialCF(problem.force, default=ng.CF((0, 0)))
    functions = moduli, voigt, force
    for at, lacking, rule in meridian_rules(partition, degree, geometry):  # some of them none
        step = max(1, AT_ONCE // (len(rule[1]) * 12 * dimension(degree)))
        for low in range(0, len(at), step):
            some = at[low : low + step]
            points = places_in(partition, some, rule, degree)
            _look(result, some, partition, lacking, points, rule[0], functions, degree, law, units)
    return result


def meridian_rules(
    partition: Partition, degree: int, geometry: int
) -> Iterator[tuple[Index, bool, tuple[Array, Array]]]:
    """Rules of quadrature for stresses of a `degree`, on curves of degree `geometry`.

    Yields
    ------
    at : ndarray of int (j,)
        Triangles, perhaps none.
    lacking : bool
        Whether they have a side on the axis.
    points, weights : ndarray (q, 2), (q,)
        The rule, as a pair.
    """
    order = 2 * degree * geometry + 2 * geometry + POINTS_BONUS
    axis = ABOUT_AXIS.at_axis(partition)[partition.triangles]
    count = axis.sum(axis=1)
    yield np.flatnonzero(count == 0), False, triangle_rule(order)
    yield np.flatnonzero(count > 1), True, triangle_rule(order)
    t, w = gauss(order + 1)
    away, across = (x.ravel() for x in np.meshgrid(t, t, indexing="ij"))
    weight = 2 * away * np.outer(w, w).ravel()
    for corner in range(3):
        first, last = CORNERS[(corner + 1) % 3], CORNERS[(corner + 2) % 3]
        opposite = first + across[:, None] * (last - first)
        points = CORNERS[corner] + away[:, None] * (opposite - CORNERS[corner])
        yield np.flatnonzero((count == 1) & axis[:, corner]), False, (points, weight)


def _basis(partition: Partition, at: Index, lacking: bool, points: Places) -> Array:
    """(rr, zz, hoop, rz) at points, (b, q, 4, 3 n), of T = each polynomial for rr, zz, rz.

    Triangles that are `lacking` have r times the polynomials of one degree less, the others are 0.
    """
    phi, r = points.values, points.place[..., 0]
    b, q, n = phi.shape
    along = np.einsum("bqdi,bdj->bqji", points.slopes, partition.inverses[at], optimize=True)
    E = np.zeros((b, q, 4, 3, n))
    E[:, :, 0, 0] = E[:, :, 1, 1] = E[:, :, 3, 2] = phi / (2 * math.pi * r[..., None])
    E[:, :, 2, 0], E[:, :, 2, 2] = along[:, :, 0] / (2 * math.pi), along[:, :, 1] / (2 * math.pi)
    return E.reshape(b, q, 4, 3 * n)


def _times_radius(partition: Partition, at: Index, degree: int) -> Array:
    """Matrices (b, n, m) that multiply polynomials of a degree less 1 by r."""
    r = partition.vertices[partition.triangles[at], 0]
    return np.einsum("ba,aij->bij", r, basis(degree).hats)


def _look(
    result: Rough,
    at: Index,
    partition: Partition,
    lacking: bool,
    points: Places,
    rule: Array,
    functions: tuple[ng.CoefficientFunction, ng.CoefficientFunction, ng.CoefficientFunction],
    degree: int,
    law: Array,
    units: tuple[float, float],
) -> None:
    """Fill in the triangles `at` (b,)."""
    b, n, m = len(at), points.values.shape[2], result.divergence.shape[3]
    C, sigma, F = (partition.evaluate(f, at, rule) for f in functions)
    C, sigma = C.reshape(*C.shape[:2], 4, 4) / units[1], sigma / units[0]
    F = F * (partition.length / units[0])
    r, hats, grad = points.place[..., 0], points.hats, points.gradients  # (b, q, 3, 2)
    measure, area = ABOUT_AXIS.measure(points.place), partition.areas[at]
    w = points.weight * measure
    half = np.linalg.inv(np.linalg.cholesky(C)) * np.sqrt(w * area[:, None])[:, :, None, None]
    E = (half @ _basis(partition, at, lacking, points)).reshape(b, -1, 3 * n)
    if lacking:
        times = _times_radius(partition, at, degree)
        times = np.einsum("cd,bij->bcidj", np.eye(3), times).reshape(b, 3 * n, 3 * m)
        E = E @ times
    gram = E.transpose(0, 2, 1) @ E
    into = np.linalg.inv(np.linalg.cholesky(gram)).transpose(0, 2, 1)
    rr, zz, hoop, rz = (sigma[..., i, None] for i in range(4))
    radial, axial = (grad[..., 0] * x + grad[..., 1] * y for x, y in ((rr, rz), (rz, zz)))
    target = np.stack([hats * rr, hats * zz, np.empty_like(radial), hats * rz], axis=2)
    target[:, :, 2] = hats * (hoop - r[..., None] * F[..., :1]) + r[..., None] * radial
    goal = (half @ target).reshape(b, -1, 3)
    hatted = (goal.transpose(0, 2, 1) @ E) @ into
    hoops = half[:, :, :, 2, None] * (r[..., None] * points.values[..., :3])[:, :, None]
    around = (hoops.reshape(b, -1, 3).transpose(0, 2, 1) @ E) @ into
    raw = (into @ hatted.sum(axis=1)[:, :, None])[..., 0]
    result.rest[at] = np.linalg.norm(goal.sum(axis=2) - (E @ raw[:, :, None])[..., 0], axis=1)
    if lacking:
        into = times @ into
    few = into.shape[2]
    result.into[at], result.hatted[at] = 0.0, 0.0
    result.into[at, :, :few], result.hatted[at, :, :few] = into, hatted
    result.around[at, :, :few] = around
    low = points.values[:, :, :m]
    radius = _times_radius(partition, at, degree - 1) if lacking else None
    tests = (points.weight[:, :, None] * points.values[..., :3]).transpose(0, 2, 1)
    result.moments[at, :, 0] = (2 * math.pi * tests @ target[:, :, 2]).transpose(0, 2, 1)
    _loads(result, at, points, low, radius, axial - hats * F[..., 1:], F[..., 1], area)
    result.distortion[at] = points.distortion
    mandel = MANDEL[4]
    result.least[at] = np.linalg.eigvalsh(C * mandel[:, None] * mandel)[..., 0].min(axis=1)
    half = np.linalg.inv(np.linalg.cholesky(law[at]))[:, None]
    ratio = np.linalg.eigvalsh(half @ C @ half.transpose(0, 1, 3, 2))[..., -1]
    result.most[at] = ratio.max(axis=1)


def _loads(
    result: Rough,
    at: Index,
    points: Places,
    low: Array,
    times: Array | None,
    d: Array,
    F: Array,
    area: Array,
) -> None:
    """Project axial loads, `d` (b, q, 3) of the patches and `F` (b, q), times 2 pi r.

    To the polynomials `low` (b, q, m), or at the axis, where the shear stress vanishes, to the
    `times` (b, m, l) of them that are r times a polynomial.
    """
    measure, w = ABOUT_AXIS.measure(points.place), points.weight
    tests = (w[:, :, None] * low).transpose(0, 2, 1)
    weighted = (w * measure)[:, :, None] * low
    moments, of_force = tests @ (measure[..., None] * d), weighted.transpose(0, 2, 1) @ F[..., None]
    mass = tests @ low
    into = np.linalg.inv(mass)
    if times is not None:
        # Tests are polynomials of one degree less, of which there are as many: r g is met in them.
        few = times.shape[2]
        into = np.zeros_like(mass)
        into[:, :, :few] = times @ np.linalg.inv(mass[:, :few] @ times)
    result.divergence[at, :, 1] = (into @ moments).transpose(0, 2, 1)
    result.force[at, 1] = (into @ of_force)[..., 0]
    result.force_means[at, 1] = of_force[..., 0]
    result.moments[at, :, 1] = moments.transpose(0, 2, 1)[..., :3]
    result.gram[at] = (weighted.transpose(0, 2, 1) @ low)[:, :3, :3]
    F = measure * F
    off = F - (low @ result.force[at, 1, :, None])[..., 0]
    missed, size = (np.sqrt(area * (w * f**2).sum(axis=1)) for f in (off, F))
    result.missed[at] = np.where(missed > ROUND_OFF * size, missed, 0.0)
