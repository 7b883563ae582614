"""One solved mesh: displacement, contact and forces, which all that comes after reads."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np

from .arrays import Array, Index, Mask
from .contact import ContactState, by_line, curves_at_ends, signed_distance, state_of
from .discrete import DiscreteProblem, RigidMotion, resultants
from .fem import (
    FacetTrace,
    Moduli,
    contact_modulus,
    energy_norm,
    model_of,
    moduli_of,
    normal_stress_of,
    potential_energy,
    stress_of,
)
from .problem import Problem
from .qp import Iterate, kkt_residuals

STRESS_FREE = 1e-12  # norm of a stress, relative to the terms that cancel in it: round-off


@dataclass(frozen=True, eq=False)
class Solved:
    """The solved mesh that all rooms read; `Solution` explains its fields."""

    problem: Problem
    mesh: ng.Mesh
    order: int
    element: str
    displacement: ng.GridFunction
    discrete: DiscreteProblem
    minimiser: Iterate
    work: dict[str, int] = field(default_factory=dict)

    @property
    def stress(self) -> ng.CoefficientFunction:
        """Stress, a (3, 3) CoefficientFunction, (2, 2) in the plane, in units of stress.

        Members that are computed on first use from the mesh require it: estimate, bound, values at
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

        nu (xx + yy) in plane strain, less E e0_zz with an initial strain, 0 where a general `Hooke`
        law does not determine it and in plane stress, the hoop stress about an axis.
        """
        return normal_stress_of(self.problem, self.displacement)

    @property
    def hoop_stress(self) -> ng.CoefficientFunction:
        """Hoop stress of a body of revolution, a scalar, in units of stress; refused in planes."""
        normal = self.out_of_plane_stress
        if not model_of(self.problem).extent:
            raise ValueError("a plane model has no hoop stress: out_of_plane_stress is what it has")
        return normal

    @cached_property
    def moduli(self) -> Moduli:
        """Moduli of the elements, stresses."""
        return moduli_of(self.problem, self.mesh)

    @cached_property
    def pairs(self) -> list[ContactState]:
        """Gap, force, pressure and state of the points of each pair, in arrays of their own."""
        lines = self.discrete.lines
        parts = by_line(lines, self.gap), by_line(lines, self.force), by_line(lines, self.active)
        return [ContactState(*of_line) for of_line in zip(lines, *parts, strict=True)]

    @cached_property
    def expected(self) -> list[ContactState]:
        """The pairs as a finer mesh should find them, see `ContactState.expected`."""
        problem, trace, found = self.problem, self.discrete.space.trace, list[ContactState]()
        if problem.dim == 3:
            return self.pairs
        for state in self.pairs:
            sides = trace.element[state.line.segments], trace.element[state.line.facing]
            modulus = contact_modulus(problem, self.moduli, *sides)
            found.append(state.expected(modulus, trace.model))
        return found

    @cached_property
    def points(self) -> Array:
        """Contact points C_j on the secondary before deformation, (m, d), a length."""
        none = np.zeros((0, self.problem.dim))
        return np.concatenate([none, *(pair.line.position for pair in self.pairs)])

    @cached_property
    def pair(self) -> Index:
        """Number of the pair in ``problem.contact`` of each point, (m,)."""
        return np.repeat(np.arange(len(self.pairs)), [pair.gap.size for pair in self.pairs])

    @property
    def direction(self) -> Array:
        """Unit direction (m, d) of each point, from the secondary to the primary, dimensionless.

        The traction on the secondary is -pressure d, the force of a point on it -force d.
        """
        none = np.zeros((0, self.problem.dim))
        return np.concatenate([none, *(pair.line.direction for pair in self.pairs)])

    @cached_property
    def gap(self) -> Array:
        """Gap (m,) after deformation along each point's direction, a length; >= 0 to round-off."""
        program = self.discrete.program
        return program.g - self.minimiser.u[program.unknown]  # (3.9), (3.9')

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
        """Resultant (d,) of a pair's contact forces on its secondary, force per thickness."""
        state = state_of(self.pairs, pair)
        forces = -(state.force[:, None] * state.line.direction).sum(axis=0)
        return model_of(self.problem).resultant(forces)

    @cached_property
    def nodal_reaction(self) -> Array:
        """Forces (n, d) of the supports on the nodes, force per thickness, A u - f + B' force."""
        d, space = self.discrete, self.discrete.space
        internal = space.A @ space.unknowns(self.displacement)
        residual = internal - space.condensed(space.right_side)
        nodal = space.basis.T @ residual + d.rows.matrix.T @ self.force
        return nodal.reshape(self.problem.dim, -1).T

    @cached_property
    def reactions(self) -> dict[str, Array]:
        """Resultant (d,) of every boundary of Gamma_u, Gamma_0 on its body, force per thickness.

        At a node of several of them each has the parts along the directions that it prescribes; a
        direction that several prescribe is shared in proportion to their lengths or areas there. A
        name that several bodies share gives the sum over them.
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

    def transitions(self, pair: int = 0) -> Any:
        """Points (k, 2) where a pair's contact turns from binding to non-binding, each a length.

        Of solids a list of polylines (k, 3), on the secondary before deformation: closed ones end
        where they start, others at the rim of the secondary or of what faces it. None, k = 0 or an
        empty list, where all of the pair is in contact, or nothing. Beside a corner, one side of
        which opens between two contact points only, there are none either.
        """
        state, trace = state_of(self.pairs, pair), self.discrete.space.trace
        if isinstance(trace, FacetTrace):
            return curves_at_ends(signed_distance(self.problem, self.moduli, trace, state))
        return state.transitions.position

    @cached_property
    def energy(self) -> float:
        """Total potential energy L(u_h) of HH81 (2.6), per unit thickness.

        With initial strains what the stress stores, less the work of the loads; in plane strain
        without what is stored by parts normal to the plane alone, E e0_zz^2 / 2.
        """
        return potential_energy(self.problem, self.discrete.space, self.displacement)

    @cached_property
    def energy_norm(self) -> float:
        """A(u_h, u_h)^(1/2), root of an energy per unit thickness.

        Of e(u_h) - e0 with initial strains: the norm of the stress, whatever the bodies expand.
        """
        return energy_norm(self.problem, self.discrete.space, self.displacement)

    @property
    def stress_free(self) -> bool:
        """Whether all stress is round-off: bodies move rigidly and expand freely."""
        return self.energy_norm <= STRESS_FREE * self.discrete.space.terms(self.displacement)

    @cached_property
    def residuals(self) -> dict[str, float]:
        """Residuals of the Karush-Kuhn-Tucker conditions, dimensionless.

        `equilibrium`: unbalanced force over the largest force or term of a force; `penetration`:
        negative gap over the largest displacement or closed gap; `tension`: negative over largest
        contact force;
        `complementarity`: sum of force times gap over force times length.
        """
        return kkt_residuals(self.discrete.program, self.minimiser)


def full_stress(solution: Solved) -> ng.CoefficientFunction:
    """Stress components xx, yy, xy, zz, the one normal to the plane, (4,); of solids yz, xz."""
    stress = solution.stress
    plane = stress[0, 0], stress[1, 1], stress[0, 1]
    if solution.mesh.dim == 3:
        return ng.CF((*plane, stress[2, 2], stress[1, 2], stress[0, 2]))
    return ng.CF((*plane, solution.out_of_plane_stress))
