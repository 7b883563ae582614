"""Triangles that a certificate has in points: curved ones, and those of laws that vary."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ..data import lattice, sampling_order, triangle_rule
from .record import Proof


def sampled_arrays(proof: Proof, at: Index) -> dict[str, Array]:
    """Maps, discrete stresses and moduli of the triangles `at` (r,), by name.

    The maps as places (r, m, 2) of lattice points, the others at the points of quadrature.
    """
    discrete, units = proof.discrete, proof.units
    partition, geometry = discrete.partition, discrete.geometry
    rule, weights = triangle_rule(sampling_order(discrete.degree, geometry))
    xx, xy, _, yy = proof.sigma
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
        "sampled_stress": partition.evaluate(ng.CF((xx, yy, xy)), at, rule),
        "sampled_law": C[:, :1] if same else C,
    }
