"""What files and pictures read of a solution."""

from __future__ import annotations

from typing import Protocol

import ngsolve as ng

from ..arrays import Array, Index, Mask
from ..problem import Problem


class SolutionData(Protocol):
    """A displacement, its stress and its m contact points, in any consistent units."""

    @property
    def problem(self) -> Problem:
        """The data: model, materials and contact pairs."""

    @property
    def mesh(self) -> ng.Mesh:
        """The mesh, of ne triangles."""

    @property
    def order(self) -> int:
        """Degree of the displacement."""

    @property
    def displacement(self) -> ng.GridFunction:
        """u_h, two components, lengths."""

    @property
    def stress(self) -> ng.CoefficientFunction:
        """In-plane stress (2, 2), a force per area."""

    @property
    def out_of_plane_stress(self) -> ng.CoefficientFunction:
        """Stress normal to the plane, a force per area."""

    @property
    def points(self) -> Array:
        """Contact points (m, 2) before deformation, lengths."""

    @property
    def pair(self) -> Index:
        """Number (m,) of the pair of each point."""

    @property
    def direction(self) -> Array:
        """Unit direction (m, 2) of each point, from the secondary to the primary."""

    @property
    def gap(self) -> Array:
        """Gap (m,) after deformation, a length."""

    @property
    def force(self) -> Array:
        """Nodal contact forces (m,), per unit thickness."""

    @property
    def pressure(self) -> Array:
        """Pressure (m,), a force per area."""

    @property
    def active(self) -> Mask:
        """Points in contact, (m,)."""

    @property
    def estimated(self) -> bool:
        """Whether `indicators` have been computed already."""

    @property
    def indicators(self) -> Array:
        """Error indicators (ne,) in the energy norm."""
