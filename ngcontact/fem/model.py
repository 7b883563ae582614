"""Models of a body: what its strains, stresses, integrals and rigid motions are.

One object for each model; `Elastic.voigt` has the law of each. Nothing else depends on the name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TypeAlias

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..problem import AXIS_RADIUS, Elastic, Hooke, MeshArrays, on_axis

CF: TypeAlias = ng.CoefficientFunction
Laws: TypeAlias = Mapping[str, Elastic | Hooke]
Strains: TypeAlias = Mapping[str, tuple[Elastic | Hooke, CF]]

MERIDIAN = (0, 1, 3)  # components of rr, zz, hoop, rz without the hoop


@lru_cache
def summing(n: int, *rows: tuple[int, ...]) -> CF:
    """Matrix (r, n) whose products are sums of some entries of a vector (n,), `rows` of numbers.

    A vector that NGSolve puts together from a tuple costs 30 microseconds, such a product one.
    """
    matrix = np.zeros((len(rows), n))
    for row, at in zip(matrix, rows, strict=True):
        row[list(at)] = 1.0
    return ng.CF(tuple(matrix.ravel().tolist()), dims=matrix.shape)


class Model:
    """Plane strain of unit thickness, components xx, yy, xy; other models override it."""

    dim = 2  # components of a displacement
    # Which translations and rotations of a body cause no strain.
    motions: tuple[bool, ...] = (True, True, True)
    bonus = 0  # quadrature orders above the default that its forms need
    polynomial = True  # whether the stress of a polynomial displacement is one of one degree less
    extent = 0  # powers of a length in `measure`
    components: tuple[int, ...] = (0, 1, 3)  # of an initial strain, those of Voigt strains
    bulges = True  # whether strains normal to the plane act in it

    def strain(self, u: CF | list[CF]) -> CF:
        """Voigt strain (q,) of a displacement or trial function, e_ij in HH81 (2.6).

        In the plane also of the two components of one, each a function of its own.
        """
        if isinstance(u, list):
            x, y = map(ng.grad, u)
            return summing(2, (0,), (), (1,)) * x + summing(2, (), (1,), (0,)) * y
        return summing(4, (0,), (3,), (1, 2)) * ng.Grad(u).Reshape((4,))  # (2.6)

    def initial_strain(self, law: Elastic | Hooke, e: CF) -> CF:
        """Voigt strain (q,) that leaves a body without stress in the plane.

        Of an initial strain with the components `e` (6,). The normal part, which has no way out in
        plane strain, bulges the plane by nu times itself.
        """
        found = summing(6, *((i,) for i in self.components)) * e
        if self.bulges and isinstance(law, Elastic):  # others have no such part: `Problem.check`
            found += law.nu * (summing(6, (2,), (2,), ()) * e)
        return found

    def stress(self, C: CF, e: CF) -> CF:
        """Voigt stress (q,) of a strain `e` (q,) by the law `C` (q, q), tau_ij in HH81 (2.6)."""
        return C * e  # (2.6)

    def work(self, C: CF, u: CF | list[CF], v: CF | list[CF]) -> list[CF]:
        """Densities over the plane mesh whose integrals add up to A(u, v) of HH81 (3.1)."""
        return [ng.InnerProduct(self.stress(C, self.strain(u)), self.strain(v))]  # (3.1)

    def compliance(self, C: CF) -> CF:
        """The part (3, 3) in the plane of the inverse of a law `C` (q, q)."""
        return ng.Inv(C)

    def volume(self, u: CF) -> CF:
        """Change of volume div u of a displacement or test function."""
        return ng.Trace(ng.Grad(u))

    def gradients(self, u: CF, v: CF) -> CF:
        """Product of the gradients of two displacements."""
        return ng.InnerProduct(ng.Grad(u), ng.Grad(v))

    def weighted(self, density: CF) -> CF:
        """Integrand over the plane mesh, or its boundary, of a density of the body."""
        return density

    def measure(self, points: Array) -> Array:
        """The factor (k,) of that, at `points` (k, 2) of the mesh."""
        return np.ones(len(points))

    def on_axis(self, points: Array) -> Mask:
        """Mask (k,) of the `points` (k, 2) of a boundary at which the body has no extent."""
        return np.zeros(len(points), dtype=bool)

    def resultant(self, force: Array) -> Array:
        """Resultant (2,) in the body of `force` (2,), a sum over nodes in the plane."""
        return force

    def in_plane(self, voigt: CF) -> CF:
        """Stress (2, 2) in the plane by its q Voigt components."""
        return (summing(3, (0,), (2,), (2,), (1,)) * voigt).Reshape((2, 2))

    def out_of_plane(self, materials: Laws, strains: Strains, mesh: ng.Mesh, voigt: CF) -> CF:
        """Stress normal to the plane by `voigt`; 0 in plane strain of laws that do not tell."""
        nu = {body: law.nu for body, law in materials.items() if isinstance(law, Elastic)}
        normal = mesh.MaterialCF(nu, default=0) * (voigt[0] + voigt[1])
        held = {k: law.E * e[2] for k, (law, e) in strains.items() if isinstance(law, Elastic)}
        return normal - mesh.MaterialCF(held, default=0) if held else normal

    def divergence(self, plane: CF, stress: CF, normal: Callable[[], CF]) -> CF:
        """Divergence (2,) by that in the plane, `plane` (2,), `stress` (2, 2), `normal` to it."""
        return plane


class _PlaneStress(Model):
    """A thin sheet, free to change its thickness."""

    bulges = False

    def out_of_plane(self, materials: Laws, strains: Strains, mesh: ng.Mesh, voigt: CF) -> CF:
        return ng.CF(0.0)


class _Axisymmetric(Model):
    """A body of revolution by its section x = r >= 0: rr, zz, hoop, rz; forces of the whole."""

    motions = (False, True, False)
    bonus = 1  # order 2 has points on the sides of elements, where r may be 0
    polynomial = False
    extent = 1
    components = (0, 1, 2, 3)
    bulges = False

    def strain(self, u: CF) -> CF:
        rr, zz, rz = super().strain(u)
        hoop = u[0] / ng.x
        if isinstance(u, ng.GridFunction):  # forms are integrated inside of elements
            tiny = AXIS_RADIUS * float(MeshArrays(u.space.mesh).vertices[:, 0].max())
            hoop = ng.IfPos(ng.x - tiny, hoop, rr)
        return ng.CF((rr, zz, hoop, rz))  # (2.6)

    def work(self, C: CF, u: CF, v: CF) -> list[CF]:
        # Of gradients, with hoop strains, of these alone: half the time of all at once.
        e, d = super().strain(u), super().strain(v)
        plane = ng.CF(tuple(C[i, j] for i in MERIDIAN for j in MERIDIAN), dims=(3, 3))
        across = ng.CF(tuple(C[i, 2] for i in MERIDIAN))
        mixed = ng.InnerProduct(across, e) * v[0] + u[0] * ng.InnerProduct(across, d)
        parts = (ng.x * ng.InnerProduct(plane * e, d), mixed, C[2, 2] * u[0] * v[0] / ng.x)
        return [(2 * math.pi * part).Compile() for part in parts]  # (3.1)

    def compliance(self, C: CF) -> CF:
        # The inverse of the Schur complement of the hoop entry.
        rest = [C[i, j] - C[i, 2] * C[2, j] / C[2, 2] for i in MERIDIAN for j in MERIDIAN]
        return ng.Inv(ng.CF(tuple(rest), dims=(3, 3)))

    def volume(self, u: CF) -> CF:
        e = self.strain(u)
        return e[0] + e[1] + e[2]

    def gradients(self, u: CF, v: CF) -> CF:
        return super().gradients(u, v) + self.strain(u)[2] * self.strain(v)[2]

    def weighted(self, density: CF) -> CF:
        return (2 * math.pi * ng.x) * density

    def measure(self, points: Array) -> Array:
        return 2 * math.pi * points[:, 0]

    def on_axis(self, points: Array) -> Mask:
        return on_axis(points)

    def resultant(self, force: Array) -> Array:
        return np.array([0.0, force[1]])  # radial forces cancel around the axis

    def in_plane(self, voigt: CF) -> CF:
        return (summing(4, (0,), (3,), (3,), (1,)) * voigt).Reshape((2, 2))

    def out_of_plane(self, materials: Laws, strains: Strains, mesh: ng.Mesh, voigt: CF) -> CF:
        return voigt[2]

    def divergence(self, plane: CF, stress: CF, normal: Callable[[], CF]) -> CF:
        return plane + ng.CF((stress[0, 0] - normal(), stress[0, 1])) / ng.x  # inside of elements


class _Solid(Model):
    """A body in space: xx, yy, zz, yz, xz, xy, with engineering shear strains."""

    dim = 3
    motions = (True,) * 6  # translations along and rotations about x, y and z
    components = (0, 1, 2, 4, 5, 3)
    bulges = False

    def strain(self, u: CF) -> CF:
        rows = (0,), (4,), (8,), (5, 7), (2, 6), (1, 3)
        return summing(9, *rows) * ng.Grad(u).Reshape((9,))  # (2.6)

    def in_plane(self, voigt: CF) -> CF:
        """Stress (3, 3) by its Voigt components."""
        rows = (0,), (5,), (4,), (5,), (1,), (3,), (4,), (3,), (2,)
        return (summing(6, *rows) * voigt).Reshape((3, 3))

    def out_of_plane(self, materials: Laws, strains: Strains, mesh: ng.Mesh, voigt: CF) -> CF:
        """Refused: all of the stress of a solid is in its tensor."""
        raise ValueError("a solid has no stress out of a plane: .stress has all of it, (3, 3)")


PLANE, SOLID_MODEL = Model(), _Solid()

MODELS: dict[str, Model] = {
    "plane strain": PLANE,
    "plane stress": _PlaneStress(),
    "axisymmetric": _Axisymmetric(),
}
