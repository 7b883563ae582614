"""What an error estimate is, and what an estimator is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import ngsolve as ng

from ..arrays import Array
from ..contact import ContactState
from ..fem import BoundaryTrace
from ..problem import Problem


@dataclass(frozen=True, eq=False)
class Estimate:
    """Error indicators of the ne elements.

    Attributes
    ----------
    indicators : ndarray (ne,)
        eta_T, an energy norm: the root of an energy per unit thickness.
    parts : dict of ndarray (ne,)
        Squared contributions by name: energies, 0 or inf where these are out of a float's range.
    """

    indicators: Array
    parts: dict[str, Array]


class Estimator(Protocol):
    """A function that estimates the error of a discrete solution, element by element."""

    def __call__(
        self,
        problem: Problem,
        boundary: BoundaryTrace,
        displacement: ng.GridFunction,
        stress: ng.CoefficientFunction,
        pairs: Sequence[ContactState],
    ) -> Estimate:
        """Estimate the error of a displacement in the energy norm.

        Parameters
        ----------
        problem : Problem
            The data.
        boundary : BoundaryTrace
            The boundary of the mesh, with the degree of the displacement.
        displacement : ng.GridFunction
            u_h.
        stress : ng.CoefficientFunction
            sigma_h, (2, 2), a force per area.
        pairs : sequence of ContactState
            Gaps and contact forces of each pair of `problem.contact`.
        """
