"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, p* >= 0 on Gamma_K, and w that corrects what u_h
misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w; docs/bounds.md has the proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...contact import ContactState
from ...errors import ContactError
from ...fem import BoundaryTrace, voigt_stress
from ...problem import Problem
from .constants import data_terms
from .data import (
    Discrete,
    EdgeConditions,
    Partition,
    Units,
    bent_segments,
    degree_for,
    discrete_on,
    divided_elements,
    edge_conditions,
    partition_of,
    units_of,
)
from .guides import exerted, work_of_guides
from .liftings import (
    Gap,
    gap_of,
    least_lifting,
    on_guides,
    on_supports,
    without_idle,
)
from .parts import ErrorBound, complementarity, summed, work_of_supports
from .pressures import (
    Pieces,
    Reach,
    Zone,
    contact_ends,
    facing_cuts,
    pieces_of,
    reaches_of,
    selected,
    split,
    zone_of,
)
from .proofs import Norms, Proof, sampled_stress
from .refusals import refuse_bound, refuse_narrow
from .remainders import asked_tractions, missed_tractions
from .stress import SETTLED, ContactPressure, EquilibratedStress, settled
from .stresses import bubble_norms

MOSTLY = 0.5  # share of what tractions miss on curves in B^2 from which a higher degree is tried
HIGHER = 2  # degrees; one more is of no use, odd and even ones meet a turning normal alike


def error_bound(
    problem: Problem,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    stress: ng.CoefficientFunction,
    pairs: Sequence[ContactState],
) -> ErrorBound:
    """Bound of the error of a displacement in the energy norm.

    Parameters
    ----------
    problem, boundary, displacement, stress, pairs
        See `Estimator`.

    Raises
    ------
    ValueError
        A problem for which no bound is known.
    ContactError
        Loads that no pressure balances, or no equilibrated stress.
    """
    refuse_bound(problem, boundary, pairs)
    refuse_narrow(problem, boundary)
    data, degree = (problem, boundary, displacement, stress, pairs), degree_for(boundary)
    found = _with_ends(*data, degree)
    if found.parts["curves"] <= MOSTLY * found.bound**2:
        return found
    try:
        return min(found, _with_ends(*data, degree + HIGHER), key=lambda one: one.bound)
    except ContactError:  # the first one is a bound, too
        return found


def _with_ends(*data: Any) -> ErrorBound:
    """The bound by a stress of a degree; its p* ends where contact does, if that balances."""
    try:
        return _bound(True, *data)
    except ContactError:
        return _bound(False, *data)


def _bound(
    ending: bool,
    problem: Problem,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    stress: ng.CoefficientFunction,
    pairs: Sequence[ContactState],
    degree: int,
) -> ErrorBound:
    """The same with a p* that ends where contact does, if it is `ending`, or on whole segments."""
    units = units_of(problem, boundary, stress)
    partition, every_pieces, reaches = _partition(problem, boundary, pairs, units, degree, ending)
    hoop = voigt_stress(problem, displacement)[2] if units.extent else None
    discrete = discrete_on(problem, boundary, partition, stress, units, degree, hoop)
    conditions = edge_conditions(problem, boundary, partition, discrete.degree, units.traction)
    solved = displacement, stress
    zones, (discrete, given, coefficients) = _pressures(
        pairs, (every_pieces, reaches), boundary, solved, discrete, conditions, units
    )
    gaps = _gaps(zones, every_pieces, boundary, displacement, partition, conditions, units)
    every_pieces = [gap.pieces for gap in gaps]
    balanced = settled(discrete, conditions, given)
    solution = problem, boundary, displacement, discrete, units
    fields, across = on_supports(*solution), on_guides(*solution)
    constitutive, off = balanced.found.norms(discrete), [*fields, *across]
    square = float(constitutive @ constitutive)
    lifting = least_lifting(problem, boundary, conditions, discrete, off, gaps, units, square)
    strips = asked_tractions(problem, boundary, discrete, zones, every_pieces, coefficients, units)
    stressed = balanced.raw, balanced.traction
    guides = exerted(discrete, stressed, strips, balanced.residuals, len(gaps))
    loads = data_terms(discrete, discrete.forces.missed, conditions.missed)
    norms = Norms(
        partition=partition,
        constitutive=constitutive,
        loads=bubble_norms(discrete, conditions) + loads,
        curves=data_terms(discrete, 0 * loads, missed_tractions(discrete, stressed, strips)),
        lifting=lifting,
    )
    works = [complementarity(gap, b) for gap, b in zip(gaps, coefficients, strict=True)]
    closed, signed = (sum(part) for part in zip((0.0, 0.0), *works, strict=True))
    signed -= work_of_guides(discrete, guides, across)
    data = discrete, conditions, given, balanced.raw, gaps, coefficients, guides, strips
    more = units, problem, sampled_stress(discrete, stress, hoop)
    proof = Proof(*data, norms, norms.bound(closed, units), *more)
    work = work_of_supports(fields, partition, balanced.traction)
    return summed(units, norms, closed, signed, work, _stress(proof, balanced.residuals))


def _pressures(
    pairs: Sequence[ContactState],
    parts: tuple[Sequence[Pieces], Sequence[Reach]],
    boundary: BoundaryTrace,
    solved: tuple[ng.GridFunction, ng.CoefficientFunction],
    discrete: Discrete,
    conditions: EdgeConditions,
    units: Units,
) -> tuple[list[Zone], tuple[Discrete, Array, list[Array]]]:
    """p* near to the forces; on all of the lines if those resultants are out of its reach."""

    def chosen(everywhere: bool) -> tuple[list[Zone], tuple[Discrete, Array, list[Array]]]:
        degree = discrete.degree - 1 - units.extent
        every_pieces, reaches = parts
        zones = [
            zone_of(pair, reach, boundary, degree, everywhere)
            for pair, reach in zip(pairs, reaches, strict=True)
        ]
        data = boundary, *solved, discrete, conditions, units
        return zones, selected(zones, every_pieces, *data)

    try:
        return chosen(everywhere=False)
    except ContactError:
        return chosen(everywhere=True)


def _gaps(
    zones: Sequence[Zone],
    every_pieces: Sequence[Pieces],
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    partition: Partition,
    conditions: EdgeConditions,
    units: Units,
) -> list[Gap]:
    """The gap of each pair, on the pieces that need something."""
    supported = np.unique(partition.ends[~conditions.constrained.all(axis=1)])
    gaps = [
        gap_of(zone, pieces, boundary, displacement, units, supported)
        for zone, pieces in zip(zones, every_pieces, strict=True)
    ]
    return without_idle(gaps, boundary)


def _partition(
    problem: Problem,
    boundary: BoundaryTrace,
    pairs: Sequence[ContactState],
    units: Units,
    degree: int,
    ending: bool,
) -> tuple[Partition, list[Pieces], list[Reach]]:
    """The triangles of the mesh, some in parts; the parts of the lines; where p* acts."""
    every_pieces = [pieces_of(pair.line, boundary) for pair in pairs]
    given = [*problem.displacement, *problem.traction, problem.sliding]
    secondaries = [pair.secondary for pair in problem.contact]
    loaded = boundary.segments(*(str(p) for p in given if p is not None))
    bent = bent_segments(boundary)
    uncut = np.union1d(loaded, bent)
    spans = contact_ends(pairs, every_pieces, boundary, uncut, ending)
    every_pieces = [split(p, s) for p, s in zip(every_pieces, spans, strict=True)]
    reaches, own = reaches_of(every_pieces, spans, uncut)
    at = np.union1d(loaded, boundary.segments(*secondaries))
    cuts, uneven = facing_cuts(every_pieces, reaches, boundary, np.union1d(at, bent), bent)
    uneven = np.append(uneven, np.array(list(own), dtype=np.intp))
    cuts |= own
    divided = divided_elements(problem, boundary, degree, uneven)
    # Two triangles meet at a cut: tractions that are not the same on both sides leave no freedom.
    divided[boundary.element[[number for number in uneven if number in cuts]]] = True
    return partition_of(boundary, units.length, divided, cuts), every_pieces, reaches


def _stress(proof: Proof, certificate: dict[str, float]) -> EquilibratedStress:
    """The equilibrated stress in the units of the data; a ContactError if it is not."""
    if max(certificate.values()) > SETTLED:
        raise ContactError(
            "no equilibrated stress was found: the residuals relative to the largest stress are "
            f"{certificate}"
        )
    discrete, units = proof.discrete, proof.units
    zones = [gap.zone for gap in proof.gaps]
    pressure = [
        ContactPressure(zone.state.line.segments, np.append(b, 0.0)[zone.number] * units.stress)
        for zone, b in zip(zones, proof.pressures, strict=True)
    ]
    unilateral = [not zone.state.line.contact.bilateral for zone in zones]
    chosen = [p.coefficients for p, one in zip(pressure, unilateral, strict=True) if one]
    least = min((float(c.min(initial=0.0)) for c in chosen), default=0.0)
    partition = discrete.partition
    return EquilibratedStress(
        degree=discrete.degree,
        triangles=partition.vertices[partition.triangles] * units.length,
        element=partition.parent,
        coefficients=proof.raw * units.traction,
        pressure=pressure,
        certificate=certificate | {"least pressure": least},
        proof=proof,
    )
