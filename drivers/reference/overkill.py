"""Errors against a much finer solution, by stresses, and against an exact one in H^1, HH81 (2.1).

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

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from drivers.reference.manufactured import gradient
from drivers.reference.straight import Exact
from drivers.reference.westergaard import CF
from ngcontact import Solution
from ngcontact.problem import MeshArrays

Array = NDArray[np.float64]
BONUS = 4  # order of integration above that of the square of the finer stress


@dataclass(frozen=True, eq=False)
class Overkill:
    """A solution that stands for the exact one, by its stress at the points of a quadrature."""

    solution: Solution  # of any laws, in plane strain or plane stress

    def __post_init__(self) -> None:
        """Refuse a model with other stresses than those in the plane."""
        if not self.solution.problem.model.startswith("plane"):
            raise ValueError(f"model = {self.solution.problem.model!r}: give a plane one")

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

    @cached_property
    def _compliance(self) -> Array:
        """Inverse laws (n, 3, 3) at the places of the quadrature, in Voigt's components."""
        problem, mesh = self.solution.problem, self.solution.mesh
        points, _ = _quadrature(mesh, 2 * self.solution.order + BONUS)
        result = np.empty((len(points), 3, 3))
        for pattern, law in problem.materials.items():
            mask = np.array(list(mesh.Materials(pattern).Mask()), dtype=bool)
            at = mask[MeshArrays(mesh).bodies[points["nr"]]]
            result[at] = np.linalg.inv(law.voigt(problem.model)(points[at]).reshape(-1, 3, 3))
        return result

    def relative_error(self, solution: Solution) -> float:
        """Relative error of the stress of another solution of the problem, in the energy norm."""
        error, norm = self.energy_error(solution)
        return error / norm

    def energy_error(self, solution: Solution) -> tuple[float, float]:
        """Error of the stress of another solution in the energy norm, and the norm of this one."""
        place, weight, body, exact = self._sample
        difference = _stress_at(solution, place, body) - exact
        error, norm = (weight @ self._energy(s) for s in (difference, exact))
        return math.sqrt(error), math.sqrt(norm)

    def _energy(self, stress: Array) -> Array:
        """Twice the complementary energy (n,) of stresses (n, 4), s : C^-1 : s."""
        voigt = stress[:, [0, 3, 1]]
        return np.asarray(np.einsum("ni,nij,nj->n", voigt, self._compliance, voigt))


def _quadrature(mesh: ng.Mesh, order: int) -> tuple[NDArray[np.void], Array]:
    """Points (n,) of all elements and their weights (n,)."""
    rule = ng.IntegrationRule(ng.TRIG, order)
    points = mesh.MapToAllElements(rule, ng.VOL)
    scale = np.abs(ng.Det(ng.specialcf.JacobianMatrix(2))(points)).ravel()
    return points, scale * np.tile(rule.weights, mesh.ne)


def _bodies(mesh: ng.Mesh, points: NDArray[np.void]) -> NDArray[np.intp]:
    """Number (n,) of the body at points; the parts of one body have one name."""
    _, number = np.unique(mesh.GetMaterials(), return_inverse=True)
    return np.asarray(number[MeshArrays(mesh).bodies], dtype=np.intp)[points["nr"]]


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


def relative_h1_error(solution: Solution, exact: Exact) -> float:
    """Relative error of the displacement in the norm of H^1 over all bodies.

    Where a translation stays free (HH81 Remark 3.7) the exact displacement is the one for which
    p(u), the integral of u along it over the boundary of the body, vanishes, as it does for the
    discrete one. Integrals as in `relative_energy_error`. Raises ValueError where a rotation, or
    bodies together, stay free.
    """
    mesh, order = solution.mesh, 2 * solution.order + 8
    error = norm = 0.0
    for body, displacement in exact.displacement.items():
        u = displacement - _free_part(solution, body, displacement, order)
        v = (solution.displacement - u, ng.Grad(solution.displacement) - gradient(displacement))
        w = (u, gradient(displacement))
        squares = [sum(ng.InnerProduct(f, f) for f in fields) for fields in (v, w)]
        both = ng.CF(tuple(squares)).Compile()
        integrals = ng.Integrate(both, mesh.Materials(body), order=order)
        error, norm = error + integrals[0], norm + integrals[1]
    return math.sqrt(error / norm)


def _free_part(solution: Solution, body: str, u: CF, order: int) -> CF:
    """Translations (2,) to take off the exact displacement of a body, so that p(u) = 0."""
    total = ng.CF((0.0, 0.0))
    boundary = solution.mesh.Materials(body).Boundaries()
    for motion in solution.free_motions:
        if motion.rotation.any() or len(motion.bodies) > 1:
            raise ValueError(f"free motion {motion}: only translations of one body are taken off")
        if motion.bodies == (body,):
            along = motion.translation[0] / math.hypot(*motion.translation[0])
            z = ng.CF(tuple(along.tolist()))
            parts = ng.CF((ng.InnerProduct(u, z), 1.0))
            integral, length = ng.Integrate(parts, boundary, order=order)
            total = total + integral / length * z
    return total
