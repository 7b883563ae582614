"""Models of a body in the plane: what its strains, stresses, integrals and rigid motions are.

One object for each model; `Elastic.voigt` has the law of each. Nothing else depends on the name.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import ngsolve as ng

from ..problem import Elastic, Hooke, Problem


class Model(Protocol):
    """What the program asks a model.

    Attributes
    ----------
    motions : tuple of bool (3,)
        Which of the translations along x and y and the rotation of a body cause no strain.
    """

    motions: tuple[bool, bool, bool]

    def strain(self, u: ng.CoefficientFunction) -> ng.CoefficientFunction:
        """Voigt strain (q,) of a displacement or trial function, e_ij in HH81 (2.6)."""

    def stress(
        self, C: ng.CoefficientFunction, e: ng.CoefficientFunction
    ) -> ng.CoefficientFunction:
        """Voigt stress (q,) of a strain `e` (q,) by the law `C` (q, q), tau_ij in HH81 (2.6)."""

    def weighted(self, density: ng.CoefficientFunction) -> ng.CoefficientFunction:
        """What is integrated over the plane mesh, or its boundary, for a density of the body."""

    def in_plane(self, voigt: list[ng.CoefficientFunction]) -> ng.CoefficientFunction:
        """Stress (2, 2) in the plane by its q Voigt components."""

    def out_of_plane(
        self,
        materials: Mapping[str, Elastic | Hooke],
        mesh: ng.Mesh,
        stress: ng.CoefficientFunction,
    ) -> ng.CoefficientFunction:
        """Stress normal to the plane, a scalar, for the `stress` (2, 2) in it."""


class _Plane:
    """A slice of unit thickness: xx, yy, xy."""

    motions = (True, True, True)

    def strain(self, u: ng.CoefficientFunction) -> ng.CoefficientFunction:
        """(e_xx, e_yy, 2 e_xy)."""
        grad = ng.Grad(u)
        return ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))  # (2.6)

    def stress(
        self, C: ng.CoefficientFunction, e: ng.CoefficientFunction
    ) -> ng.CoefficientFunction:
        """(xx, yy, xy)."""
        return C * e  # (2.6)

    def weighted(self, density: ng.CoefficientFunction) -> ng.CoefficientFunction:
        """The density itself."""
        return density

    def in_plane(self, voigt: list[ng.CoefficientFunction]) -> ng.CoefficientFunction:
        """((xx, xy), (xy, yy))."""
        xx, yy, xy = voigt
        return ng.CF((xx, xy, xy, yy), dims=(2, 2))


class PlaneStrain(_Plane):
    """A slice of a long body that cannot stretch along its axis."""

    def out_of_plane(
        self,
        materials: Mapping[str, Elastic | Hooke],
        mesh: ng.Mesh,
        stress: ng.CoefficientFunction,
    ) -> ng.CoefficientFunction:
        """Nu (xx + yy); a general law does not say what it is: 0 is taken there."""
        nu = {body: law.nu for body, law in materials.items() if isinstance(law, Elastic)}
        return mesh.MaterialCF(nu, default=0) * (stress[0, 0] + stress[1, 1])


class PlaneStress(_Plane):
    """A thin sheet, free to change its thickness."""

    def out_of_plane(
        self,
        materials: Mapping[str, Elastic | Hooke],
        mesh: ng.Mesh,
        stress: ng.CoefficientFunction,
    ) -> ng.CoefficientFunction:
        """0."""
        return ng.CF(0.0)


MODELS: dict[str, Model] = {"plane strain": PlaneStrain(), "plane stress": PlaneStress()}


def model_of(problem: Problem) -> Model:
    """The model of a problem."""
    return MODELS[problem.model]


def stress_of(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """Stress (2, 2) in the plane of a displacement, sigma_h, in the units of the moduli."""
    model, mesh = model_of(problem), displacement.space.mesh
    e = model.strain(displacement)
    by_body = {
        body: model.stress(law.voigt(problem.model), e) for body, law in problem.materials.items()
    }
    components = range(e.dim)
    return model.in_plane(
        [mesh.MaterialCF({body: s[i] for body, s in by_body.items()}) for i in components]
    )
