"""The dual problem of a contact force: a stress in equilibrium without loads, near to that of G."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ....arrays import Array, power_of_two
from ....errors import ContactError
from ....fem import BoundaryTrace
from ....problem import Problem
from ..constants import data_terms
from ..data import Units, discrete_on
from ..guides import Reactions, reactions_of
from ..liftings import EdgeField, lifted, on_contact, on_guides
from ..pressures import selected
from ..proofs import Proof
from ..remainders import asked_tractions, missed_tractions
from ..stress import SETTLED, settled
from .excess import Excess, jump_beside, least_kappa

ROOM = 2.0  # largest |q*| / p* over the ratio of their means, where contact has no open end


@dataclass(frozen=True, eq=False)
class Tested:
    """A displacement G that tests one component of one contact force.

    Attributes
    ----------
    displacement : ng.GridFunction
        G, without a unit: [G] = d.e at the active points of the pair, 0 at those of others.
    stress : ng.CoefficientFunction
        Its stress (2, 2) in the plane, stress per length.
    forces : sequence of ndarray (m,)
        Its nodal contact forces on each pair, force per thickness and length.
    directions : sequence of ndarray (2,)
        e on the pair, 0 on the others.
    """

    displacement: ng.GridFunction
    stress: ng.CoefficientFunction
    forces: Sequence[Array]
    directions: Sequence[Array]


@dataclass(frozen=True, eq=False)
class Dual:
    """What the dual stress proves, on n triangles; numbers over `units`.

    Attributes
    ----------
    units : Units
        Of stress, of modulus and length as those of the solution.
    kappa : float
        |q*| <= kappa p*, and [G + w] - d.e is at most kappa times the gap.
    excess : list of Excess
        [G] - d.e of each pair.
    traction : ndarray (n, 3, r)
        Of the dual stress on edges.
    pressures : list of ndarray (m,)
        Coefficients of q* of each pair.
    guides : Reactions or None
        What it exerts on turning guides.
    across : list of EdgeField
        What is lifted there.
    lifting, norms : ndarray (ne,)
        |w|, and |t - C e(G)| + |w| with what data leave.
    """

    units: Units
    kappa: float
    excess: list[Excess]
    traction: Array
    pressures: list[Array]
    guides: Reactions | None
    across: list[EdgeField]
    lifting: Array
    norms: Array


def dual_of(problem: Problem, boundary: BoundaryTrace, tested: Tested, proof: Proof) -> Dual:
    """Equilibrate the stress of G on the triangles of a proof.

    Raises
    ------
    ValueError
        Contact of which the gap vanishes where it is open.
    ContactError
        No such stress.
    """
    partition = proof.discrete.partition
    middle = ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1])
    values = np.asarray(tested.stress(boundary.mesh.MapToAllElements(middle, ng.VOL)))
    units = replace(proof.units, stress=power_of_two(values))
    free = replace(problem, force={}, traction={})
    discrete = discrete_on(free, boundary, partition, tested.stress, units, proof.discrete.degree)
    conditions = replace(
        proof.conditions,
        given=np.zeros_like(proof.conditions.given),
        higher=np.zeros_like(proof.conditions.higher),
        missed=np.zeros_like(proof.conditions.missed),
    )
    kappa, excess = _excess(boundary, tested, proof, units)
    pieces = [gap.pieces for gap in proof.gaps]
    zones = [
        replace(gap.zone, state=replace(gap.zone.state, force=force))
        for gap, force in zip(proof.gaps, tested.forces, strict=True)
    ]
    limits = [
        np.full(len(b), np.inf) if zone.state.line.contact.bilateral else kappa * b
        for zone, b in zip(zones, proof.pressures, strict=True)
    ]
    G, sigma = tested.displacement, tested.stress
    discrete, given, q = selected(
        zones, pieces, boundary, G, sigma, discrete, conditions, units, limits
    )
    balanced = settled(discrete, conditions, given)
    if balanced.worst > SETTLED:
        raise ContactError(f"no dual stress was found: residuals {balanced.residuals}")
    strips = asked_tractions(free, boundary, discrete, zones, pieces, q, units)
    stressed = balanced.raw, balanced.traction
    guides = reactions_of(discrete, stressed, len(zones))
    strips += [] if guides is None else [guides.strip]
    curves = missed_tractions(discrete, stressed, strips)
    across = on_guides(problem, boundary, G, discrete, units)
    moves = [*across, *(field for one in excess for field in on_contact(one, discrete))]
    lifting = lifted(discrete, moves)
    missed = data_terms(discrete, np.zeros(len(partition.triangles)), curves)
    norms = partition.of_elements(balanced.found.norms(discrete) + missed) + lifting
    return Dual(units, kappa, excess, balanced.traction, q, guides, across, lifting, norms)


def _excess(
    boundary: BoundaryTrace, tested: Tested, proof: Proof, units: Units
) -> tuple[float, list[Excess]]:
    """The least kappa for which nothing is left at vertices, and what is left elsewhere."""
    found = []
    for gap, e in zip(proof.gaps, tested.directions, strict=True):
        name = gap.pieces.line.contact.secondary
        if not len(gap.pieces.local):
            raise ValueError(
                f'no bar of the force is proved beside a pair, "{name}", without points of its own'
            )
        if not gap.pieces.whole:
            raise ValueError(
                f'no bar of the force is proved where nodes do not face nodes, as on "{name}"'
            )
        found.append((gap, jump_beside(gap, tested.displacement, boundary, e, units)))
    kappa = max(least_kappa(gap, values) for gap, values in found)
    kappa = max(kappa, _mean_ratio(tested, proof) * proof.units.stress / units.stress)
    if not np.isfinite(kappa):
        raise ValueError(
            "no bar of the force is proved where supports end contact, or an open gap is 0"
        )
    return kappa, [Excess(gap, values, kappa) for gap, values in found]


def _mean_ratio(tested: Tested, proof: Proof) -> float:
    """`ROOM` times the mean of |q| over that of p, of unilateral pairs in contact."""
    pairs = [
        (np.abs(force).sum(), gap.zone.state.force.sum())
        for gap, force in zip(proof.gaps, tested.forces, strict=True)
        if not gap.zone.state.line.contact.bilateral
    ]
    return ROOM * max((float(q / p) for q, p in pairs if p > 0), default=0.0)
