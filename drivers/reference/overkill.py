"""Errors against a much finer solution, where no exact one is known: by stresses.

sqrt(2 (L(u_h) - L(u))) bounds the error only where K_h lies in K and the meshes cover the body: on
curved boundaries and between the nodes of higher orders it may be anything, imaginary included.
Stresses can be compared anywhere. The integral runs over the finer mesh, at points that resolve its
solution; points that lie outside of the coarser one, between its boundary and the curve, take the
stress of the point nearest to them in their body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ngcontact.problem import Elastic, Triangulation

if TYPE_CHECKING:
    from ngcontact.solution import Solution

Array = NDArray[np.float64]
BONUS = 4  # order of integration above that of the square of the finer stress


@dataclass(frozen=True, eq=False)
class Overkill:
    """A solution that stands for the exact one, by its stress at the points of a quadrature.

    Attributes
    ----------
    solution : Solution
        In plane strain, of isotropic bodies with constant moduli.
    """

    solution: Solution

    def __post_init__(self) -> None:
        """Refuse what `_energy` has no formula for."""
        if self.solution.problem.model != "plane strain":
            raise ValueError(f"model = {self.solution.problem.model!r}: give 'plane strain'")
        self._laws  # noqa: B018

    @cached_property
    def _laws(self) -> Array:
        """Poisson's ratio and twice the shear modulus of every body (b, 2)."""
        mesh = self.solution.mesh
        result = np.empty((len(mesh.GetMaterials()), 2))
        for pattern, law in self.solution.problem.materials.items():
            if not (isinstance(law, Elastic) and isinstance(law.E, float)):
                raise TypeError(f"materials[{pattern!r}] = {law!r}: give constant moduli")
            mask = np.array(list(mesh.Materials(pattern).Mask()), dtype=bool)
            result[mask] = law.nu, law.E / (1 + law.nu)
        return result

    @cached_property
    def _sample(self) -> tuple[Array, Array, NDArray[np.intp], Array]:
        """Places (n, 2), weights (n,), bodies (n,) and stresses (n, 4) of the quadrature."""
        order = 2 * self.solution.order + BONUS
        points, weights = _quadrature(self.solution.mesh, order)
        return (
            ng.CF((ng.x, ng.y))(points),
            weights,
            _bodies(self.solution.mesh, points),
            self.solution.stress(points),
        )

    def relative_error(self, solution: Solution) -> float:
        """Relative error of the stress of another solution of the problem, in the energy norm."""
        place, weight, body, exact = self._sample
        difference = _stress_at(solution, place, body) - exact
        error, norm = (weight @ self._energy(s, body) for s in (difference, exact))
        return math.sqrt(error / norm)

    def _energy(self, stress: Array, body: NDArray[np.intp]) -> Array:
        """Twice the complementary energy (n,) of stresses (n, 4), s : C^-1 : s in plane strain."""
        nu, shear = self._laws[body].T
        trace = stress[:, 0] + stress[:, 3]
        return ((stress * stress).sum(axis=1) - nu * trace * trace) / shear


def _quadrature(mesh: ng.Mesh, order: int) -> tuple[NDArray[np.void], Array]:
    """Points (n,) of all elements and their weights (n,)."""
    rule = ng.IntegrationRule(ng.TRIG, order)
    points = mesh.MapToAllElements(rule, ng.VOL)
    scale = np.abs(ng.Det(ng.specialcf.JacobianMatrix(2))(points)).ravel()
    return points, scale * np.tile(rule.weights, mesh.ne)


def _bodies(mesh: ng.Mesh, points: NDArray[np.void]) -> NDArray[np.intp]:
    """Material region (n,) of points."""
    return np.asarray(Triangulation(mesh).bodies, dtype=np.intp)[points["nr"]]


def _stress_at(solution: Solution, place: Array, body: NDArray[np.intp]) -> Array:
    """Stress (n, 4) at places (n, 2) of bodies (n,); outside of the mesh that of the nearest."""
    mesh = solution.mesh
    points = mesh(*place.T.copy())
    found = points["nr"] >= 0
    found[found] = _bodies(mesh, points[found]) == body[found]  # the other body may touch
    stress = np.empty((len(place), 4))
    stress[found] = solution.stress(points[found])
    lost = np.flatnonzero(~found)
    if lost.size:
        cloud, _ = _quadrature(mesh, 2 * solution.order + BONUS)
        inside, where = _bodies(mesh, cloud), ng.CF((ng.x, ng.y))(cloud)
        for number in np.unique(body[lost]):
            mine, here = lost[body[lost] == number], np.flatnonzero(inside == number)
            _, nearest = KDTree(where[here]).query(place[mine])
            stress[mine] = solution.stress(cloud[here[nearest]])
    return stress
