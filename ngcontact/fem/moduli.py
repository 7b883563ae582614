"""Sizes and moduli of elements, nearly incompressible bodies, units for squares."""

from __future__ import annotations

import logging
from collections.abc import Callable

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..mesh import middles
from ..problem import Elastic, Hooke, Problem, Triangulation, varies

# kappa / mu from which a body counts as nearly incompressible: nu = 5/12; nowhere in plane stress.
NEARLY_INCOMPRESSIBLE = 6.0
# ... and from which order 1 locks: nu = 0.4545, where errors are 1.3 times those of nu = 0.3.
LOCKING = 11.0

log = logging.getLogger("ngcontact")


def _of_elements(problem: Problem, mesh: ng.Mesh, modulus: Callable[..., Array]) -> Array:
    """modulus(law, points) (ne,) in the middle of each element; of one where a law is constant."""
    region = Triangulation(mesh).bodies
    points, values = middles(mesh), np.zeros(mesh.ne)
    for pattern, law in problem.materials.items():
        at = np.flatnonzero(np.array(mesh.Materials(pattern).Mask())[region])
        values[at] = modulus(law, points[at if varies(law) else at[:1]])
    return values


def shear_moduli(problem: Problem, mesh: ng.Mesh) -> Array:
    """Shear modulus (ne,) in the middle of each element, a stress."""

    def modulus(law: Elastic | Hooke, points: NDArray) -> Array:
        return np.asarray(law.shear_modulus(problem.model)(points)).ravel()

    return _of_elements(problem, mesh, modulus)


def bulk_moduli(problem: Problem, mesh: ng.Mesh) -> Array:
    """Bulk modulus (ne,) in the middle of each element: the largest kappa <= e : C e / (tr e)^2.

    A stress, lambda + mu of isotropic laws in plane strain. A Schur complement in C on volumetric,
    deviatoric and shear strain, which does not cancel where C_11, C_12 and C_22 are nearly equal.
    """

    def modulus(law: Elastic | Hooke, points: NDArray) -> Array:
        C = np.asarray(law.voigt(problem.model)(points)).reshape(-1, 3, 3)
        size = np.abs(C).max(axis=(1, 2))
        T = np.array([[0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [0.0, 0.0, 1.0]])
        D = T @ (C / size[:, None, None]) @ T.T
        bend = np.linalg.solve(D[:, 1:, 1:], D[:, 1:, :1])
        return np.asarray(size * (D[:, 0, 0] - (D[:, :1, 1:] @ bend)[:, 0, 0]))

    return _of_elements(problem, mesh, modulus)


def nearly_incompressible(problem: Problem, mesh: ng.Mesh, limit: float) -> dict[str, float]:
    """Largest kappa / mu of each body where it exceeds `limit`."""
    ratio = bulk_moduli(problem, mesh) / shear_moduli(problem, mesh)
    region = Triangulation(mesh).bodies
    most = dict.fromkeys(mesh.GetMaterials(), 0.0)
    for number, name in enumerate(mesh.GetMaterials()):
        most[name] = max(most[name], float(ratio[region == number].max(initial=0.0)))
    return {name: value for name, value in most.items() if value > limit}


def warn_of_locking(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Log a warning for every body that elements of order 1 are too stiff for."""
    if order > 1:
        return
    for name, ratio in nearly_incompressible(problem, mesh, LOCKING).items():
        log.warning(
            'body "%s" is nearly incompressible, lambda / mu = %.3g: elements of order 1 lock; '
            "use order=2 or higher",
            name,
            ratio - 1,
        )
