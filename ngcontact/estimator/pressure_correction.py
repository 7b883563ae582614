"""Estimates of nearly incompressible bodies: the pressure that balances the residuals best.

Residuals contain kappa div u_h, weighted by 1 / mu; the error counts its square over kappa, the
bulk modulus. So the stress is corrected by a pressure delta before residuals are taken. For every
delta, from a(e, v) = r(v; sigma_h + delta I) - (delta, div v) and r(v_h; sigma_h) = 0, with the
interpolant v_h of v, the squared error is at most a constant, which does not depend on kappa, times

    eta(sigma_h + delta I)^2 + |delta|^2 / kappa + sup (delta, div v_h)^2 / mu |grad v_h|^2.

The estimate is the minimum of this over polynomials of the displacement's degree on each element.
It is at most a multiple of the error, as one of them is delta = p - p_h but for oscillation: then
the last term measures the deviatoric error, because e is orthogonal to v_h.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, from_triplets
from ..linalg import cholesky, lower_half, shared
from ..problem import MeshArrays, region_mask
from ..quadrature import local_functions
from .terms import BoundaryResidual, ScaledSolution

# Stiffness of supports in the last term, relative to the elements beside them.
SUPPORT_STIFFNESS = 1e6
CURVED = 2  # quadrature orders for the maps of curved elements
FLOATING = 1e-9  # ... and of the bedding that keeps free bodies, relative to their size


@dataclass(frozen=True, eq=False)
class PressureCorrection:
    """What the minimising delta adds to residuals, over the unit of stress."""

    divergence: ng.CoefficientFunction  # grad delta, (2,)
    jump: ng.CoefficientFunction  # [delta n], (2,)
    on_boundary: list[Array]  # (k, c) of each term on the boundary
    squares: Array  # (ne,), of the two terms that delta itself adds


def pressure_correction(
    solution: ScaledSolution,
    names: Iterable[str],
    divergence: ng.CoefficientFunction,
    jump: ng.CoefficientFunction,
    terms: Sequence[BoundaryResidual],
) -> PressureCorrection:
    """The minimising delta on nearly incompressible bodies `names`, found with v_h of the supremum.

    For that the supremum is mu |grad v_h|^2. Residuals are div sigma_h + F in the elements, the
    `divergence` (2,), [sigma_h n] on their edges, the `jump` (2,), and the `terms` on the boundary.
    Pressures and moduli are in the units of the `solution`.
    """
    problem, mesh, model = solution.problem, solution.mesh, solution.model
    weighted, n = model.weighted, ng.specialcf.normal(2)
    region = mesh.Materials("|".join(map(re.escape, names)))
    pressures = ng.L2(mesh, order=solution.order, dgjumps=True)
    motions = ng.VectorH1(mesh, order=solution.order, definedon=region)
    (delta, t), (v, w) = pressures.TnT(), motions.TnT()
    weights = solution.element_weight, solution.edge_weight, solution.mu, solution.bulk
    element, edge, mu, kappa = map(solution.on_elements, weights)
    edge = (edge + edge.Other()) / 2
    bedding = FLOATING / float(np.ptp(solution.boundary.curve, axis=(0, 1)).max()) ** 2
    bonus = model.bonus + CURVED
    dx, inside = ng.dx(bonus_intorder=bonus), ng.dx(definedon=region, bonus_intorder=bonus)
    skeleton = ng.dx(skeleton=True, bonus_intorder=CURVED)
    a, f = ng.BilinearForm(pressures, symmetric=True), ng.LinearForm(pressures)
    a += weighted(element * ng.Grad(delta) * ng.Grad(t) + delta * t / kappa) * dx
    a += weighted(edge * (delta - delta.Other()) * (t - t.Other())) * skeleton
    f += weighted(-element * divergence * ng.Grad(t)) * dx
    f += weighted(-edge * (jump * n) * (t - t.Other())) * skeleton
    b = ng.BilinearForm(trialspace=pressures, testspace=motions)
    b += weighted(delta * model.volume(w)) * inside
    k = ng.BilinearForm(motions, symmetric=True)
    k += weighted(mu * (model.gradients(v, w) + bedding * v * w)) * inside
    held = ng.BoundaryFromVolumeCF(SUPPORT_STIFFNESS * mu) / ng.specialcf.mesh_size
    products = [
        (pattern, v.Trace()[axis] * w.Trace()[axis])
        for pattern, components in problem.displacement.items()
        for axis, value in enumerate(components)
        if value is not None
    ]
    if problem.guide is not None:
        products.append((problem.guide, (v.Trace() * n) * (w.Trace() * n)))
    for pattern, product in products:
        k += weighted(held * product) * ng.ds(definedon=mesh.Boundaries(pattern))
    for form in (a, f, b, k):
        form.Assemble()
    every = [_on_boundary(solution, pressures, term) for term in terms]
    R = sp.vstack(every, "csr")
    weight = np.concatenate([np.repeat(x.weight, x.residual.shape[1]) for x in terms])
    residual = np.concatenate([x.residual.ravel() for x in terms])
    A, B, K = shared(a.mat) + R.T @ R.multiply(weight[:, None]), shared(b.mat), shared(k.mat)
    # Optimality of delta and of v_h; [[A, B'], [B, -K]] is quasi-definite: it has a factorisation
    # without pivots.
    saddle = sp.block_array([[A, B.T], [B, -K]], format="csr")
    right = np.append(f.vec.FV().NumPy() - R.T @ (weight * residual), np.zeros(motions.ndof))
    elements, size = region_mask(region)[MeshArrays(mesh).bodies], pressures.ndof
    free = np.append(elements.repeat(size // mesh.ne), K.diagonal() > 0)
    found = np.where(free, cholesky(lower_half(saddle))(free)(right), 0.0)
    delta, v = ng.GridFunction(pressures), ng.GridFunction(motions)
    delta.vec.FV().NumPy()[:], v.vec.FV().NumPy()[:] = found[:size], found[size:]
    order = 2 * solution.order + bonus
    density = weighted(delta**2 / kappa + mu * model.gradients(v, v))
    return PressureCorrection(
        divergence=ng.Grad(delta),
        jump=(delta - delta.Other()) * n,
        on_boundary=[
            (one @ found[:size]).reshape(term.residual.shape)
            for one, term in zip(every, terms, strict=True)
        ],
        squares=np.asarray(ng.Integrate(density, region, order=order, element_wise=True)),
    )


def _on_boundary(
    solution: ScaledSolution, pressures: ng.FESpace, term: BoundaryResidual
) -> sp.csr_array:
    """Matrix (k * c, n) from coefficients of delta to what it adds to residuals (k, c)."""
    boundary, (k, c) = solution.boundary, term.residual.shape
    numbers = np.arange(pressures.ndof).reshape(solution.mesh.ne, -1)  # those of elements, in order
    shapes = ng.BoundaryFromVolumeCF(local_functions(pressures, numbers))
    rows = sp.csr_array((k * c, numbers.size))
    for share in term.shares:
        if len(share.at):
            value = boundary.evaluate(shapes, share.segment, share.s)
            column = numbers[boundary.element[share.segment], None]
            row = share.at[:, None, None] * c + np.arange(c)[:, None]
            row, column = np.broadcast_arrays(row, column)
            entries = share.factor[:, :, None] * value[:, None, :]
            rows += from_triplets(entries.ravel(), row.ravel(), column.ravel(), rows.shape)
    return rows
