"""What a user reads: displacement, pressure, gap, forces, certificates."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property

import ngsolve as ng
import numpy as np

from . import __version__
from .adaptivity import Descent
from .arrays import Array, Index, Mask, root_of_squares
from .contact import ContactState, contact_states, state_of
from .discrete import DiscreteProblem, RigidMotion, resultants
from .estimator import Estimate, Estimator, Measured, estimate
from .fem import energy_norm, model_of, normal_stress_of, potential_energy, stress_of
from .output import Shown
from .problem import Problem
from .qp import Iterate, kkt_residuals
from .results import Readable, read


@dataclass(frozen=True, eq=False)
class Solution(Measured, Readable, Shown):
    """Exact minimiser u_h of L over K_h on one mesh: HH81 (P_1h), (P_2h).

    Contact quantities are arrays over the m contact points, all pairs in order.

    Attributes
    ----------
    problem : Problem
        What was solved.
    mesh : ng.Mesh
        The (curved) mesh.
    order : int
        Polynomial degree of the displacement.
    element : str
        "isoparametric", "superparametric" or "physical".
    displacement : ng.GridFunction
        u_h, a length, on a VectorH1 space; "unknowns" means ``displacement.space.ndof``.
    discrete : DiscreteProblem
        The algebraic problem.
    minimiser : Iterate
        Its solution.
    work : dict
        Counts of assemblies, factorizations, back_solves, gap_searches, curved_elements, estimates
        and equilibrations spent on this solution, on its mesh. Without factorisation V-cycles of
        multigrid count as back_solves. And evaluations: points at which functions among the data
        were looked at for warnings, jumps and roughness, in `adapt` by the level itself; beside
        those are checks that data are finite, interpolation and quadrature. 0 where all data are
        numbers.
    coarse_levels : int
        Levels of the coarse adaptive run that told `solve` the first active set of a large mesh.
    adaptive : bool
        Whether it is a level of `adapt`, whose estimate is needed anyway.
    estimator : Estimator
        What tells `indicators`.
    descent : Descent or None
        Of a level of `adapt`: the first mesh, and which of its elements those of `mesh` are parts
        of.
    """

    problem: Problem
    mesh: ng.Mesh
    order: int
    element: str
    displacement: ng.GridFunction
    discrete: DiscreteProblem
    minimiser: Iterate
    work: dict[str, int] = field(default_factory=dict)
    coarse_levels: int = 0
    adaptive: bool = False
    estimator: Estimator = estimate
    descent: Descent | None = None

    @property
    def stress(self) -> ng.CoefficientFunction:
        """In-plane stress, a (2, 2) CoefficientFunction, in units of stress.

        What is computed on first use and looks at the mesh asks for it: estimate, bound, values at
        points, files and pictures.

        Raises
        ------
        RuntimeError
            The mesh was refined or moved in place since.
        """
        self.discrete.space.require_mesh()
        return stress_of(self.problem, self.displacement)

    @cached_property
    def out_of_plane_stress(self) -> ng.CoefficientFunction:
        """Stress normal to the plane, a scalar CoefficientFunction, in units of stress.

        nu (xx + yy) in plane strain, 0 where a general `Hooke` law does not tell it and in plane
        stress, the hoop stress about an axis.
        """
        return normal_stress_of(self.problem, self.displacement)

    @property
    def hoop_stress(self) -> ng.CoefficientFunction:
        """Hoop stress of a body of revolution, a scalar, in units of stress; refused in planes."""
        return model_of(self.problem).hoop(self.out_of_plane_stress)

    @cached_property
    def pairs(self) -> list[ContactState]:
        """Gap, force, pressure and state of the points of each pair, in arrays of their own."""
        program = self.discrete.program
        gap = program.g - self.minimiser.u[program.unknown]  # (3.9), (3.9')
        return contact_states(self.discrete.lines, gap, self.force, self.active)

    @cached_property
    def points(self) -> Array:
        """Contact points C_j on the secondary before deformation, (m, 2), a length."""
        return np.concatenate([np.zeros((0, 2)), *(pair.line.position for pair in self.pairs)])

    @cached_property
    def pair(self) -> Index:
        """Number of the pair in ``problem.contact`` of each point, (m,)."""
        return np.repeat(np.arange(len(self.pairs)), [pair.gap.size for pair in self.pairs])

    @cached_property
    def gap(self) -> Array:
        """Gap (m,) after deformation along each point's direction, a length; >= 0 to round-off."""
        return np.concatenate([np.zeros(0), *(pair.gap for pair in self.pairs)])

    @property
    def force(self) -> Array:
        """Nodal contact forces lambda_j, (m,), a force per unit thickness."""
        return self.minimiser.force

    @cached_property
    def pressure(self) -> Array:
        """-T_n per unit length (P1), -T_xi per unit eta (P2), (m,), in units of stress."""
        return np.concatenate([np.zeros(0), *(pair.pressure for pair in self.pairs)])

    @property
    def active(self) -> Mask:
        """Points in contact, (m,)."""
        return self.minimiser.active

    @property
    def steps(self) -> list[int]:
        """Changes of the active set after each linear system; the last one is 0."""
        return self.minimiser.steps

    def contact_force(self, pair: int = 0) -> Array:
        """Resultant (2,) of a pair's contact forces on its secondary, force per thickness."""
        state = state_of(self.pairs, pair)
        forces = -(state.force[:, None] * state.line.direction).sum(axis=0)
        return model_of(self.problem).resultant(forces)

    @cached_property
    def nodal_reaction(self) -> Array:
        """Forces (n, 2) of the supports on the nodes, force per thickness, A u - f + B' force."""
        d = self.discrete
        residual = d.space.A @ self.displacement.vec.FV().NumPy() - d.space.f
        return (d.space.basis.T @ residual + d.B.T @ self.force).reshape(2, -1).T

    @cached_property
    def reactions(self) -> dict[str, Array]:
        """Resultant (2,) of every boundary of Gamma_u, Gamma_0 on its body, force per thickness.

        A node shared by several of them counts for the last entry of `displacement`, then for
        `sliding`; a name that several bodies share gives the sum over them.
        """
        return resultants(self.problem, self.discrete.space.trace, self.nodal_reaction)

    @cached_property
    def free_motions(self) -> list[RigidMotion]:
        """Rigid motions that neither supports nor active contact resist (HH81 Remark 3.7).

        The displacement is determined but for these; of those that no contact point resists, it
        is the one whose component along them vanishes in the mean over the body's boundary.
        """
        rigid = self.discrete.rigid
        return [] if rigid is None else rigid.left_free(self.active)

    def transitions(self, pair: int = 0) -> Array:
        """Points (k, 2) where a pair's contact turns from binding to non-binding, each a length.

        None, k = 0, where all of the pair is in contact, or nothing.
        """
        return state_of(self.pairs, pair).transitions.position

    @cached_property
    def energy(self) -> float:
        """Total potential energy L(u_h) of HH81 (2.6), per unit thickness."""
        return potential_energy(self.problem, self.discrete.space, self.displacement)

    @cached_property
    def energy_norm(self) -> float:
        """A(u_h, u_h)^(1/2), root of an energy per unit thickness."""
        return energy_norm(self.problem, self.discrete.space, self.displacement)

    @cached_property
    def _estimate(self) -> Estimate:
        self.work["estimates"] += 1
        boundary = self.discrete.space.trace
        return self.estimator(self.problem, boundary, self.displacement, self.stress, self.pairs)

    @property
    def estimated(self) -> bool:
        """Whether the error estimate has been computed already."""
        return "_estimate" in self.__dict__

    @property
    def indicators(self) -> Array:
        """Local error indicators eta_T, (ne,), root of an energy per unit thickness."""
        return self._estimate.indicators

    @property
    def estimate_parts(self) -> dict[str, Array]:
        """Squared contributions (ne,) to the indicators by origin, energy per thickness."""
        return self._estimate.parts

    @property
    def error_estimate(self) -> float:
        """Estimated A(u - u_h, u - u_h)^(1/2), root of an energy per unit thickness."""
        return root_of_squares(self.indicators)

    @property
    def relative_error_estimate(self) -> float:
        """Estimated error over the energy norm of u_h, dimensionless; 0 where both vanish."""
        if self.error_estimate == 0:
            return 0.0
        return self.error_estimate / self.energy_norm if self.energy_norm > 0 else float("inf")

    @cached_property
    def residuals(self) -> dict[str, float]:
        """Residuals of the Karush-Kuhn-Tucker conditions, dimensionless.

        `equilibrium`: unbalanced force over the largest force or term of a force; `penetration`:
        negative gap over the largest displacement or closed gap; `tension`: negative over largest
        contact force;
        `complementarity`: sum of force times gap over force times length.
        """
        return kkt_residuals(self.discrete.program, self.minimiser)

    __repr__ = Readable.__str__  # instead of all arrays


def load(path: str | os.PathLike[str]) -> Solution:
    """The solution that `Solution.save` wrote to `path`.

    Displacement and contact are equal to the last bit. The stiffness is assembled again, and
    factorised when it is next needed. The file is a pickle: load only what you or people you trust
    have written.

    Raises
    ------
    ValueError
        A file that is no result, is not complete, or is of a version that cannot be read here.
    """
    solution: Solution = read(path, __version__)
    return solution
