"""Triangles that a certificate has in points: curved ones, and those of laws that vary."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ..data import Discrete, lattice, sampling_order, triangle_rule
from .record import Proof


def sampled_stress(discrete: Discrete, stress: ng.CoefficientFunction) -> Array:
    """(xx, yy, xy) of a `stress` (2, 2) at q points of r sampled triangles, (r, q, 3)."""
    if discrete.rough is None or discrete.balance.extent:
        return np.zeros((0, 0, 3))
    rule, _ = triangle_rule(sampling_order(discrete.degree, discrete.geometry))
    xx, xy, _, yy = stress
    function = ng.CF((xx, yy, xy)).Compile()
    return discrete.partition.evaluate(function, discrete.rough.at, rule)


def sampled_arrays(proof: Proof, at: Index) -> dict[str, Array]:
    """Maps, discrete stresses and moduli of the triangles `at` (r,), by name.

    The maps as places (r, m, 2) of lattice points, the others at the points of quadrature.
    """
    discrete, units = proof.discrete, proof.units
    partition, geometry = discrete.partition, discrete.geometry
    rule, weights = triangle_rule(sampling_order(discrete.degree, geometry))
    laws = {name: law.voigt(proof.problem.model) for name, law in proof.problem.materials.items()}
    moduli = partition.evaluate(partition.mesh.MaterialCF(laws), at, rule)
    C = moduli.reshape(*moduli.shape[:2], 3, 3)
    same = bool((C == C[:, :1]).all())
    corners = lattice(geometry)
    return {
        "sampled_triangle": at,
        "sampled_degree": np.array(geometry),
        "sampled_lattice": corners,
        "sampled_map": partition.places(at, corners) * units.length,
        "sampled_points": rule,
        "sampled_weights": weights,
        "sampled_exact": np.array(sampling_order(discrete.degree, geometry)),
        "sampled_stress": proof.sampled,
        "sampled_law": C[:, :1] if same else C,
    }
