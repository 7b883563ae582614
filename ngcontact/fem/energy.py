"""Stresses and energies of a displacement."""

from __future__ import annotations

import math

import ngsolve as ng
import numpy as np

from ..arrays import Array, power_of_two
from ..problem import Problem
from .model import model_of
from .space import Space

CANCELLED = 1e-6  # energy relative to its terms below which fewer than ten digits are left


def potential_energy(problem: Problem, space: Space, displacement: ng.GridFunction) -> float:
    """L(u_h) of HH81 (2.6), per unit thickness."""
    size, energy = _scaled_energy(problem, space, displacement)
    work = float(space.f / size @ (displacement.vec.FV().NumPy() / size))
    return (energy / 2 - work) * size * size  # (2.6)


def energy_norm(problem: Problem, space: Space, displacement: ng.GridFunction) -> float:
    """A(u_h, u_h)^(1/2), root of an energy per unit thickness."""
    size, energy = _scaled_energy(problem, space, displacement)
    return math.sqrt(energy) * size


def _scaled_energy(
    problem: Problem, space: Space, displacement: ng.GridFunction
) -> tuple[float, float]:
    """A size s of the displacement, whose squares may leave the range, and A(u_h / s, u_h / s).

    From the strains where large rigid motions would cancel.
    """
    u, mesh, order = displacement.vec.FV().NumPy(), space.trace.mesh, space.trace.order
    size = power_of_two(u)
    u = u / size
    energy = float(u @ (space.A @ u))
    if energy <= CANCELLED * float(space.diagonal @ u**2):
        space.require_mesh()
        model = model_of(problem)
        e, energy = model.strain(displacement) / size, 0.0
        for body, law in problem.materials.items():
            stress = model.stress(law.voigt(problem.model), e)
            density = model.weighted(ng.InnerProduct(stress, e)).Compile()
            energy += ng.Integrate(density, mesh.Materials(body), order=2 * order + 2)
    return size, energy


def voigt_stress(problem: Problem, displacement: ng.GridFunction) -> list[ng.CoefficientFunction]:
    """The q Voigt components of the stress of a displacement, in the units of the moduli."""
    model, mesh = model_of(problem), displacement.space.mesh
    e = model.strain(displacement)
    by_body = {
        body: model.stress(law.voigt(problem.model), e) for body, law in problem.materials.items()
    }
    return [mesh.MaterialCF({body: s[i] for body, s in by_body.items()}) for i in range(e.dim)]


def stress_of(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """Stress (2, 2) in the plane of a displacement, sigma_h, in the units of the moduli."""
    return model_of(problem).in_plane(voigt_stress(problem, displacement))


def normal_stress_of(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """Stress normal to the plane of a displacement, a scalar, in the units of the moduli."""
    voigt, mesh = voigt_stress(problem, displacement), displacement.space.mesh
    return model_of(problem).out_of_plane(problem.materials, mesh, voigt)


def von_mises(stress: Array) -> Array:
    """Von Mises stress (k,) of the components xx, yy, xy, zz in `stress` (k, 4), same units."""
    size = float(np.abs(stress).max(initial=0.0)) or 1.0  # squares must stay in range
    xx, yy, xy, zz = stress.T / size
    return size * np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)
