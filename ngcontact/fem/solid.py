"""Model of a body in space, beside those of the plane."""

from __future__ import annotations

from collections.abc import Callable

import ngsolve as ng

from .model import CF, Laws, Model, Strains


class _Solid(Model):
    """A body in space: xx, yy, zz, yz, xz, xy, with engineering shear strains."""

    dim = 3
    motions = (True,) * 6  # translations along and rotations about x, y and z
    components = (0, 1, 2, 4, 5, 3)
    bulges = False

    def strain(self, u: CF) -> CF:
        g = ng.Grad(u)
        shear = (g[1, 2] + g[2, 1], g[0, 2] + g[2, 0], g[0, 1] + g[1, 0])
        return ng.CF((g[0, 0], g[1, 1], g[2, 2], *shear))  # (2.6)

    def volume(self, u: CF) -> CF:
        return ng.Trace(ng.Grad(u))

    def in_plane(self, voigt: CF) -> CF:
        """Stress (3, 3) by its Voigt components."""
        xx, yy, zz, yz, xz, xy = voigt
        return ng.CF((xx, xy, xz, xy, yy, yz, xz, yz, zz), dims=(3, 3))

    def out_of_plane(self, materials: Laws, strains: Strains, mesh: ng.Mesh, voigt: CF) -> CF:
        """Refused: all of the stress of a solid is in its tensor."""
        raise ValueError("a solid has no stress out of a plane: .stress has all of it, (3, 3)")

    def divergence(self, plane: CF, stress: CF, normal: Callable[[], CF]) -> CF:
        return plane


SOLID_MODEL = _Solid()
