"""Triangles that a certificate has in points: curved, of laws that vary, of a meridian section."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ..data import Discrete, lattice, meridian_rules, sampling_order, triangle_rule
from .record import Proof

Rules = list[tuple[Index, tuple[Array, Array]]]


def _rules(discrete: Discrete) -> Rules:
    """The sampled triangles, and the points and weights of their quadrature."""
    if discrete.rough is None:
        return []
    degree, geometry = discrete.degree, discrete.geometry
    if discrete.balance.extent == 0:
        return [(discrete.rough.at, triangle_rule(sampling_order(degree, geometry)))]
    rules = meridian_rules(discrete.partition, degree, geometry)
    return [(at, rule) for at, _, rule in rules if at.size]


def sampled_stress(
    discrete: Discrete, stress: ng.CoefficientFunction, hoop: ng.CoefficientFunction | None
) -> list[Array]:
    """A `stress` (2, 2), and a hoop stress, at q points of r sampled triangles, (r, q, v) each.

    (xx, yy, xy), or (rr, zz, hoop, rz).
    """
    xx, xy, _, yy = stress
    function = ng.CF((xx, yy, xy) if hoop is None else (xx, yy, hoop, xy)).Compile()
    partition = discrete.partition
    return [partition.evaluate(function, at, points) for at, (points, _) in _rules(discrete)]


def sampled_arrays(proof: Proof) -> dict[str, Array]:
    """Maps, discrete stresses, moduli and radial forces of the sampled triangles, by name.

    The maps as places (r, m, 2) of lattice points, the others at the points of quadrature; these
    by number where there are several rules, as about an axis.
    """
    discrete, length = proof.discrete, proof.units.length
    partition, geometry, rules = discrete.partition, discrete.geometry, _rules(discrete)
    at, corners = np.concatenate([at for at, _ in rules]), lattice(geometry)
    arrays = {
        "sampled_triangle": at,
        "sampled_degree": np.array(geometry),
        "sampled_lattice": corners,
        "sampled_map": partition.places(at, corners) * length,
        "sampled_exact": np.array(sampling_order(discrete.degree, geometry)),
    }
    if discrete.balance.extent == 0:
        return arrays | _at_points(proof, *rules[0], proof.sampled[0], "sampled")
    for i, (rule, sigma) in enumerate(zip(rules, proof.sampled, strict=True)):
        arrays |= _at_points(proof, *rule, sigma, f"rule{i}") | {f"rule{i}_triangle": rule[0]}
    return arrays


def _at_points(
    proof: Proof, at: Index, rule: tuple[Array, Array], sigma: Array, name: str
) -> dict[str, Array]:
    """What is known in the points of a `rule` of the triangles `at` (r,)."""
    partition, problem = proof.discrete.partition, proof.problem
    laws = {body: law.voigt(problem.model) for body, law in problem.materials.items()}
    moduli, v = partition.evaluate(partition.mesh.MaterialCF(laws), at, rule[0]), sigma.shape[2]
    C = moduli.reshape(*moduli.shape[:2], v, v)
    same = bool((C == C[:, :1]).all())
    arrays = {
        f"{name}_points": rule[0],
        f"{name}_weights": rule[1],
        f"{name}_stress": sigma,
        f"{name}_law": C[:, :1] if same else C,
    }
    if proof.discrete.balance.extent:
        force = partition.mesh.MaterialCF(problem.force, default=ng.CF((0, 0)))
        arrays[f"{name}_radial"] = partition.evaluate(force, at, rule[0])[..., 0]
    return arrays
