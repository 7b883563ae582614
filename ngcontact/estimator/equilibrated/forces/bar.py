"""A bar of the contact force that is proved: docs/bounds.md has the proof."""

from __future__ import annotations

import math

import ngsolve as ng
import numpy as np

from ....fem import BoundaryTrace
from ....problem import Problem
from ..data import Units
from ..guides import work_of_guides
from ..liftings import on_guides, on_supports
from ..parts import complementarity, work_of_supports
from ..proofs import Proof
from .dual import Dual, Tested, dual_of


def force_bar(
    problem: Problem,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    tested: Tested,
    proof: Proof,
) -> float:
    """How far the tested component of a contact force is from the true one, at most.

    Loads and stiffness count as they are integrated. A force per unit thickness.

    Parameters
    ----------
    problem, boundary, displacement
        The solution.
    tested : Tested
        What its force is tested with.
    proof : Proof
        Its error bound.

    Raises
    ------
    ValueError, ContactError
        No bar is proved.
    """
    dual, units = dual_of(problem, boundary, tested, proof), proof.units
    B = proof.bound / (units.stress / math.sqrt(units.modulus) * units.length)
    M, kappa = float(np.linalg.norm(dual.norms)), dual.kappa
    # The largest M e + kappa (X + Y) with e^2 + 2 X + 2 Y <= B^2.
    error = M * B if M >= kappa * B else (M**2 / kappa + kappa * B**2) / 2
    discrete = proof.discrete
    fields = on_supports(problem, boundary, displacement, discrete, units)
    work = work_of_supports(fields, discrete.partition, dual.traction)
    for gap, q in zip(proof.gaps, dual.pressures, strict=True):
        work -= complementarity(gap, q)[1]
    own = on_guides(problem, boundary, displacement, discrete, units)
    work += work_of_guides(discrete, dual.guides, own)
    crossed = work_of_guides(discrete, proof.guides, dual.across)
    norms = proof.norms.constitutive + proof.norms.loads + proof.norms.curves
    norms = discrete.partition.of_elements(norms)
    error += abs(work) + abs(crossed) + float(norms @ dual.lifting) + _opened(dual, proof)
    return error * _unit(units, dual.units)


def _opened(dual: Dual, proof: Proof) -> float:
    """Size of the integral of p* times what is lifted of [G] - d.e."""
    parts = (complementarity(one, b) for one, b in zip(dual.excess, proof.pressures, strict=True))
    return abs(sum(after - before for after, before in parts))


def _unit(units: Units, dual: Units) -> float:
    """Of products of both stresses over moduli, integrated."""
    return units.stress * dual.stress / units.modulus * units.length**2
