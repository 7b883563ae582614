"""Models of a body in the plane: what its strains, stresses, integrals and rigid motions are.

One object for each model; `Elastic.voigt` has the law of each. Nothing else depends on the name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol, TypeAlias

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..problem import ON_AXIS, Elastic, Hooke, MeshArrays, Problem, on_axis

CF: TypeAlias = ng.CoefficientFunction
Laws: TypeAlias = Mapping[str, Elastic | Hooke]

MERIDIAN = (0, 1, 3)  # components of rr, zz, hoop, rz without the hoop


class Model(Protocol):
    """What the program asks a model.

    Attributes
    ----------
    motions : tuple of bool (3,)
        Which of the translations along x and y and the rotation of a body cause no strain.
    bonus : int
        Quadrature orders above the default that its forms need.
    polynomial : bool
        Whether the stress of a polynomial displacement is one of one degree less.
    extent : int
        Powers of a length in `measure`.
    """

    motions: tuple[bool, bool, bool]
    bonus: int
    polynomial: bool
    extent: int

    def strain(self, u: CF) -> CF:
        """Voigt strain (q,) of a displacement or trial function, e_ij in HH81 (2.6)."""

    def stress(self, C: CF, e: CF) -> CF:
        """Voigt stress (q,) of a strain `e` (q,) by the law `C` (q, q), tau_ij in HH81 (2.6)."""

    def work(self, C: CF, u: CF, v: CF) -> list[CF]:
        """Densities over the plane mesh whose integrals add up to A(u, v) of HH81 (3.1)."""

    def compliance(self, C: CF) -> CF:
        """The part (3, 3) in the plane of the inverse of a law `C` (q, q)."""

    def volume(self, u: CF) -> CF:
        """Change of volume div u of a displacement or test function."""

    def gradients(self, u: CF, v: CF) -> CF:
        """Product of the gradients of two displacements."""

    def weighted(self, density: CF) -> CF:
        """What is integrated over the plane mesh, or its boundary, for a density of the body."""

    def measure(self, points: Array) -> Array:
        """The factor (k,) of that, at `points` (k, 2) of the mesh."""

    def on_axis(self, points: Array) -> Mask:
        """Which of all `points` (k, 2) of a boundary lie where the body has no extent, (k,)."""

    def resultant(self, force: Array) -> Array:
        """Resultant (2,) in the body of `force` (2,), a sum over nodes in the plane."""

    def in_plane(self, voigt: list[CF]) -> CF:
        """Stress (2, 2) in the plane by its q Voigt components."""

    def out_of_plane(self, materials: Laws, mesh: ng.Mesh, voigt: list[CF]) -> CF:
        """Stress normal to the plane, a scalar, by the q Voigt components of the stress."""

    def hoop(self, normal: CF) -> CF:
        """The hoop stress, `normal` to the plane; a `ValueError` without an axis."""

    def divergence(self, plane: CF, stress: CF, normal: Callable[[], CF]) -> CF:
        """Divergence (2,) by that in the plane, `plane` (2,), `stress` (2, 2), `normal` to it."""


class _Linear:
    """What all models share."""

    def stress(self, C: CF, e: CF) -> CF:
        """Hooke's law."""
        return C * e  # (2.6)


class _Plane(_Linear):
    """A slice of unit thickness: xx, yy, xy."""

    motions = (True, True, True)
    bonus = 0
    polynomial = True
    extent = 0

    def strain(self, u: CF) -> CF:
        """(e_xx, e_yy, 2 e_xy)."""
        grad = ng.Grad(u)
        return ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))  # (2.6)

    def work(self, C: CF, u: CF, v: CF) -> list[CF]:
        """The one."""
        return [ng.InnerProduct(self.stress(C, self.strain(u)), self.strain(v))]  # (3.1)

    def compliance(self, C: CF) -> CF:
        """The inverse."""
        return ng.Inv(C)

    def volume(self, u: CF) -> CF:
        """That in the plane."""
        grad = ng.Grad(u)
        return grad[0, 0] + grad[1, 1]

    def gradients(self, u: CF, v: CF) -> CF:
        """In the plane."""
        return ng.InnerProduct(ng.Grad(u), ng.Grad(v))

    def weighted(self, density: CF) -> CF:
        """The density itself."""
        return density

    def measure(self, points: Array) -> Array:
        """1 for `points` (k, 2), (k,)."""
        return np.ones(len(points))

    def on_axis(self, points: Array) -> Mask:
        """None of the `points` (k, 2), (k,)."""
        return np.zeros(len(points), dtype=bool)

    def resultant(self, force: Array) -> Array:
        """The sum `force` (2,) itself, (2,), per unit thickness."""
        return force

    def hoop(self, normal: CF) -> CF:
        """There is none."""
        raise ValueError("a plane model has no hoop stress: out_of_plane_stress is what it has")

    def divergence(self, plane: CF, stress: CF, normal: Callable[[], CF]) -> CF:
        """That in the plane."""
        return plane

    def in_plane(self, voigt: list[CF]) -> CF:
        """((xx, xy), (xy, yy))."""
        xx, yy, xy = voigt
        return ng.CF((xx, xy, xy, yy), dims=(2, 2))


class PlaneStrain(_Plane):
    """A slice of a long body that cannot stretch along its axis."""

    def out_of_plane(self, materials: Laws, mesh: ng.Mesh, voigt: list[CF]) -> CF:
        """Nu (xx + yy); a general law does not say what it is: 0 is taken there."""
        nu = {body: law.nu for body, law in materials.items() if isinstance(law, Elastic)}
        return mesh.MaterialCF(nu, default=0) * (voigt[0] + voigt[1])


class PlaneStress(_Plane):
    """A thin sheet, free to change its thickness."""

    def out_of_plane(self, materials: Laws, mesh: ng.Mesh, voigt: list[CF]) -> CF:
        """0."""
        return ng.CF(0.0)


PLANE: Model = PlaneStrain()


class Axisymmetric(_Linear):
    """A body of revolution by its section x = r >= 0: rr, zz, hoop, rz; forces of the whole."""

    motions = (False, True, False)
    bonus = 1  # order 2 has points on the sides of elements, where r may be 0
    polynomial = False
    extent = 1

    def strain(self, u: CF) -> CF:
        """(e_rr, e_zz, u_r / r, 2 e_rz); the hoop strain of a solution is e_rr on the axis."""
        grad = ng.Grad(u)
        hoop = u[0] / ng.x
        if isinstance(u, ng.GridFunction):  # forms are integrated inside of elements
            tiny = ON_AXIS * float(MeshArrays(u.space.mesh).vertices[:, 0].max())
            hoop = ng.IfPos(ng.x - tiny, hoop, grad[0, 0])
        return ng.CF((grad[0, 0], grad[1, 1], hoop, grad[0, 1] + grad[1, 0]))  # (2.6)

    def work(self, C: CF, u: CF, v: CF) -> list[CF]:
        """Of gradients, with hoop strains, of these alone: half the time of all at once."""
        e, d = PLANE.strain(u), PLANE.strain(v)
        plane = ng.CF(tuple(C[i, j] for i in MERIDIAN for j in MERIDIAN), dims=(3, 3))
        across = ng.CF(tuple(C[i, 2] for i in MERIDIAN))
        mixed = ng.InnerProduct(across, e) * v[0] + u[0] * ng.InnerProduct(across, d)
        parts = (ng.x * ng.InnerProduct(plane * e, d), mixed, C[2, 2] * u[0] * v[0] / ng.x)
        return [(2 * math.pi * part).Compile() for part in parts]  # (3.1)

    def compliance(self, C: CF) -> CF:
        """The inverse of the Schur complement of the hoop entry."""
        rest = [C[i, j] - C[i, 2] * C[2, j] / C[2, 2] for i in MERIDIAN for j in MERIDIAN]
        return ng.Inv(ng.CF(tuple(rest), dims=(3, 3)))

    def volume(self, u: CF) -> CF:
        """With the hoop strain."""
        e = self.strain(u)
        return e[0] + e[1] + e[2]

    def gradients(self, u: CF, v: CF) -> CF:
        """With the hoop strains."""
        hoop = self.strain(u)[2] * self.strain(v)[2]
        return ng.InnerProduct(ng.Grad(u), ng.Grad(v)) + hoop

    def weighted(self, density: CF) -> CF:
        """2 pi r times the density."""
        return (2 * math.pi * ng.x) * density

    def measure(self, points: Array) -> Array:
        """2 pi r at `points` (k, 2), (k,)."""
        return 2 * math.pi * points[:, 0]

    def on_axis(self, points: Array) -> Mask:
        """Those of the `points` (k, 2) with r = 0, (k,)."""
        return on_axis(points)

    def resultant(self, force: Array) -> Array:
        """(0, axial part of `force` (2,)), (2,): radial forces cancel around the axis."""
        return np.array([0.0, force[1]])

    def in_plane(self, voigt: list[CF]) -> CF:
        """((rr, rz), (rz, zz))."""
        rr, zz, _, rz = voigt
        return ng.CF((rr, rz, rz, zz), dims=(2, 2))

    def out_of_plane(self, materials: Laws, mesh: ng.Mesh, voigt: list[CF]) -> CF:
        """The hoop stress."""
        return voigt[2]

    def hoop(self, normal: CF) -> CF:
        """The stress normal to the plane."""
        return normal

    def divergence(self, plane: CF, stress: CF, normal: Callable[[], CF]) -> CF:
        """With (rr - hoop) / r and rz / r, inside of elements: there r > 0."""
        return plane + ng.CF((stress[0, 0] - normal(), stress[0, 1])) / ng.x


MODELS: dict[str, Model] = {
    "plane strain": PLANE,
    "plane stress": PlaneStress(),
    "axisymmetric": Axisymmetric(),
}


def model_of(problem: Problem) -> Model:
    """The model of a problem."""
    return MODELS[problem.model]
