"""What a solution says of its error that is proved."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...fem import LOAD_BONUS, load_vector, potential_energy
from ..estimated import Estimated
from .bound import Proof, error_bound
from .stress import EquilibratedStress

ROUND_OFF = 64 * np.finfo(float).eps  # of an energy, relative to its terms
FINE = 3 * LOAD_BONUS  # quadrature orders above the default for the work of loads


class Guaranteed(Estimated):
    """Members of `Solution` that bound its error, made when the first of them is asked for."""

    @cached_property
    def _bound(self) -> Proof:
        space = self.discrete.space
        space.require_mesh()
        self.work["equilibrations"] += 1
        return error_bound(self.problem, space.trace, self.displacement, self.pairs)

    @property
    def bounded(self) -> bool:
        """Whether the bound has been made already."""
        return "_bound" in self.__dict__

    @property
    def error_bound(self) -> float:
        """At least A(u - u_h, u - u_h)^(1/2), root of an energy per unit thickness.

        u is the solution on the domain of the mesh. Proved by an equilibrated stress, but for
        round-off and for data that are no polynomials, which are looked at in points of quadrature.

        Raises
        ------
        ValueError
            A problem for which no bound is known.
        """
        return self._bound.bound

    @property
    def relative_error_bound(self) -> float:
        """`error_bound` over the energy norm of u_h, dimensionless; 0 where both vanish."""
        bound, size = self._bound.bound, self.energy_norm
        return bound / size if size > 0 else math.inf if bound > 0 else 0.0

    @property
    def bound_parts(self) -> dict[str, float]:
        """What the square of the bound is the sum of, each an energy per thickness.

        `constitutive`: |s - sigma_h|^2 of the equilibrated stress s; `complementarity`: twice the
        integral of p* times the gap; `lifting`: what correcting u_h on Gamma_u and Gamma_K costs;
        `loads`: what no polynomial meets of loads, also on curved boundaries.
        """
        return self._bound.parts

    @property
    def energy_bounds(self) -> tuple[float, float]:
        """Energies per unit thickness between which L(u) of HH81 (2.6) lies."""
        space, u = self.discrete.space, self.displacement
        if self.problem.force or self.problem.traction:
            space.require_mesh()
            space = replace(space, f=load_vector(self.problem, space.V, FINE))
        energy = potential_energy(self.problem, space, u)
        noise = ROUND_OFF * (self.energy_norm**2 + abs(energy))
        return energy - self._bound.below - noise, energy + self._bound.above + noise

    @property
    def equilibrated(self) -> EquilibratedStress:
        """The stress that proves the bound, in equilibrium with the loads; units of stress."""
        return EquilibratedStress(self._bound)
