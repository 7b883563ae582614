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
from collections.abc import Sequence

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, from_triplets
from ..fem import moduli_of
from ..linalg import cholesky, lower_half, shared
from ..problem import MeshArrays, region_mask
from ..quadrature import local_functions
from .terms import BoundaryResidual, ScaledSolution

# Stiffness of supports in the last term, relative to the elements beside them.
SUPPORT_STIFFNESS = 1e6
FLOATING = 1e-9  # ... and of the bedding that keeps free bodies, relative to their size


class PressureCorrection:
    """The minimising delta on nearly incompressible bodies `names`, and the v_h of the supremum.

    For that the supremum is mu |grad v_h|^2. `residuals` are div sigma_h + F, (2,), in the elements
    and [sigma_h n], (2,), on their edges, `terms` those on the boundary. `element` and `edge` are
    the weights of squared residuals, constant on each element, as are shear and bulk moduli;
    pressures and moduli are in the units of the `solution`.
    """

    def __init__(
        self,
        solution: ScaledSolution,
        names: Sequence[str],
        residuals: tuple[ng.CoefficientFunction, ng.CoefficientFunction],
        terms: Sequence[BoundaryResidual],
    ) -> None:
        mesh, order = solution.mesh, solution.order
        self.solution, self.model = solution, solution.model
        self.region = mesh.Materials("|".join(map(re.escape, names)))
        self.space = ng.L2(mesh, order=order, dgjumps=True)
        self.functions = self.space.ndof // mesh.ne  # on an element; they are numbered one by one
        self.V = ng.VectorH1(mesh, order=order, definedon=self.region)

        def constant(values: Array) -> ng.GridFunction:
            function = ng.GridFunction(ng.L2(mesh, order=0))
            function.vec.FV().NumPy()[:] = values
            return function

        self.element = constant(solution.element_weight)
        self.edge = constant(solution.edge_weight)
        self.mu = constant(solution.mu)
        self.kappa = constant(moduli_of(solution.problem, mesh).bulk / solution.modulus)
        (A, b), B, K = self._inside(*residuals), self._divergence(), self._stiffness()
        on_boundary = [self._on_boundary(term) for term in terms]
        for R, term in zip(on_boundary, terms, strict=True):
            weight = np.repeat(term.weight, term.residual.shape[1])
            A = A + R.T @ R.multiply(weight[:, None])
            b -= R.T @ (weight * term.residual.ravel())
        # Optimality of delta and of v_h; [[A, B'], [B, -K]] is quasi-definite: it has a
        # factorisation without pivots.
        size, inside = self.space.ndof, region_mask(self.region)[MeshArrays(mesh).bodies]
        free = np.append(np.repeat(inside, self.functions), K.diagonal() > 0)
        saddle = sp.block_array([[A, B.T], [B, -K]], format="csr")
        right = np.append(b, np.zeros(K.shape[0]))
        found = np.where(free, cholesky(lower_half(saddle))(free)(right), 0.0)
        self.pressure, self.motion = ng.GridFunction(self.space), ng.GridFunction(self.V)
        self.pressure.vec.FV().NumPy()[:] = found[:size]
        self.motion.vec.FV().NumPy()[:] = found[size:]
        self.corrected = [  # residuals (k, c) of the `terms` with delta
            term.residual + (R @ found[:size]).reshape(term.residual.shape)
            for R, term in zip(on_boundary, terms, strict=True)
        ]

    def divergence_and_jump(self) -> tuple[ng.CoefficientFunction, ng.CoefficientFunction]:
        """Grad delta and [delta n]: what delta adds inside the bodies, two of two components."""
        delta = self.pressure
        return ng.Grad(delta), (delta - delta.Other()) * ng.specialcf.normal(2)

    def squares(self) -> Array:
        """Squares (ne,) of the two terms that delta itself adds."""
        gradients = self.model.gradients(self.motion, self.motion)
        density = self.model.weighted(self.pressure**2 / self.kappa + self.mu * gradients)
        return np.asarray(ng.Integrate(density, self.region, element_wise=True))

    def _inside(
        self, divergence: ng.CoefficientFunction, jump: ng.CoefficientFunction
    ) -> tuple[sp.csr_array, Array]:
        """Quadratic form and right side (n,) of the terms in elements and between them."""
        d, t = self.space.TnT()
        weighted, element = self.model.weighted, self.element
        edge, n = (self.edge + self.edge.Other()) / 2, ng.specialcf.normal(2)
        skeleton = ng.dx(skeleton=True, bonus_intorder=2)
        a = ng.BilinearForm(self.space, symmetric=True)
        a += weighted(element * ng.Grad(d) * ng.Grad(t) + d * t / self.kappa) * ng.dx
        a += weighted(edge * (d - d.Other()) * (t - t.Other())) * skeleton
        f = ng.LinearForm(self.space)
        f += weighted(-element * divergence * ng.Grad(t)) * ng.dx(bonus_intorder=2)
        f += weighted(-edge * (jump * n) * (t - t.Other())) * skeleton
        a.Assemble()
        f.Assemble()
        return shared(a.mat), f.vec.FV().NumPy().copy()

    def _on_boundary(self, term: BoundaryResidual) -> sp.csr_array:
        """Matrix (k * c, n) from coefficients of delta to what it adds to residuals (k, c)."""
        boundary, (k, c), size = self.solution.boundary, term.residual.shape, self.space.ndof
        numbers = np.arange(size).reshape(-1, self.functions)
        shapes = ng.BoundaryFromVolumeCF(local_functions(self.space, numbers))
        rows = sp.csr_array((k * c, size))
        for share in term.shares:
            if len(share.at):
                value = boundary.evaluate(shapes, share.segment, share.s)
                column = numbers[boundary.element[share.segment], None]
                row = share.at[:, None, None] * c + np.arange(c)[:, None]
                row, column = np.broadcast_arrays(row, column)
                entries = share.factor[:, :, None] * value[:, None, :]
                rows += from_triplets(entries.ravel(), row.ravel(), column.ravel(), rows.shape)
        return rows

    def _stiffness(self) -> sp.csr_array:
        """Form of mu |grad v|^2, with v held where displacements are prescribed."""
        problem, mesh, model = self.solution.problem, self.solution.mesh, self.model
        u, v = self.V.TnT()
        position = self.solution.boundary.curve.reshape(-1, 2)
        bedding = FLOATING / float(np.ptp(position, axis=0).max()) ** 2
        a = ng.BilinearForm(self.V, symmetric=True)
        work = self.mu * (model.gradients(u, v) + bedding * u * v)
        a += model.weighted(work) * ng.dx(definedon=self.region, bonus_intorder=model.bonus)
        held = ng.BoundaryFromVolumeCF(SUPPORT_STIFFNESS * self.mu) / ng.specialcf.mesh_size
        for pattern, components in problem.displacement.items():
            for axis, value in enumerate(components):
                if value is not None:
                    ds = ng.ds(definedon=mesh.Boundaries(pattern))
                    a += model.weighted(held * u.Trace()[axis] * v.Trace()[axis]) * ds
        if problem.guide is not None:
            n = ng.specialcf.normal(2)
            ds = ng.ds(definedon=mesh.Boundaries(problem.guide))
            a += model.weighted(held * (u.Trace() * n) * (v.Trace() * n)) * ds
        a.Assemble()
        return shared(a.mat)

    def _divergence(self) -> sp.csr_array:
        """(q, div v) of pressures q and displacements v."""
        pressures = ng.L2(self.solution.mesh, order=self.solution.order)
        q, v = pressures.TrialFunction(), self.V.TestFunction()
        b = ng.BilinearForm(trialspace=pressures, testspace=self.V)
        work = self.model.weighted(q * self.model.volume(v))
        b += work * ng.dx(definedon=self.region, bonus_intorder=self.model.bonus)
        b.Assemble()
        return shared(b.mat)
