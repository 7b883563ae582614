"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, p* >= 0 on Gamma_K, and w that corrects what u_h
misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w; docs/bounds.md has the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...contact import ContactState
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...problem import Problem
from .constants import data_terms
from .data import (
    Discrete,
    Partition,
    Units,
    degree_for,
    discrete_on,
    divided_elements,
    edge_conditions,
    legendre_values,
    partition_of,
    units_of,
)
from .liftings import (
    EdgeField,
    Gap,
    at_points,
    coefficients,
    gap_of,
    lifted,
    on_contact,
    on_supports,
)
from .pressures import Zone, pieces_of, selected, zone_of
from .refusals import refuse_bound
from .remainders import missed_tractions
from .stress import ContactPressure, EquilibratedStress, certified
from .stresses import equilibrated

SETTLED = 1e-9  # residual of equilibrium, relative to the largest stress: measured 1e-15 to 1e-12


@dataclass(frozen=True, eq=False)
class ErrorBound:
    """What is proved about one discrete solution; energies per unit thickness.

    Attributes
    ----------
    bound : float
        B: at least the energy norm of the error, root of an energy.
    parts : dict of float
        Its squared parts: constitutive, complementarity, lifting, loads, curves.
    below, above : float
        Energies: L(u_h) - below <= L(u) <= L(u_h) + above.
    stress : EquilibratedStress
        The stress that proves it.
    """

    bound: float
    parts: dict[str, float]
    below: float
    above: float
    stress: EquilibratedStress


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
    units = units_of(problem, boundary, stress)
    partition = _partition(problem, boundary, pairs, units)
    discrete = discrete_on(problem, boundary, partition, stress, units)
    conditions = edge_conditions(problem, boundary, partition, discrete.degree, units.stress)
    zones = [zone_of(pair, boundary, discrete.degree - 1) for pair in pairs]
    every_pieces = [pieces_of(pair.line, boundary) for pair in pairs]
    supported = np.unique(partition.ends[~conditions.constrained.all(axis=1)])
    gaps = [
        gap_of(zone, pieces, boundary, displacement, units, supported)
        for zone, pieces in zip(zones, every_pieces, strict=True)
    ]
    discrete, given, coefficients = selected(
        zones, every_pieces, boundary, displacement, stress, discrete, conditions, units
    )
    result = equilibrated(discrete, conditions, given)
    raw, traction, certificate = certified(discrete, conditions, given, result)
    fields = on_supports(problem, boundary, displacement, discrete, units)
    others = [x for gap in gaps for x in on_contact(gap, boundary, supported, discrete)]
    closed, signed = 0.0, 0.0
    for gap, b in zip(gaps, coefficients, strict=True):
        part = _complementarity(gap, b)
        closed, signed = closed + part[0], signed + part[1]
    reaction = _work_of_supports(fields, partition, traction)
    equilibrium = _stress(discrete, zones, coefficients, raw, certificate, units)
    constitutive = np.linalg.norm(result.change, axis=1)
    if discrete.rough is not None:
        at = discrete.rough.at
        constitutive[at] = np.hypot(constitutive[at], discrete.rough.rest)
    curves = missed_tractions(
        problem, boundary, discrete, (raw, traction), zones, every_pieces, coefficients, units
    )
    loads = data_terms(discrete, discrete.missed, conditions.missed)
    curves = data_terms(discrete, 0 * discrete.missed, curves)
    lifting = lifted(discrete, fields, others)
    norms = _Norms(constitutive, loads, curves, lifting)
    return _summed(units, norms, closed, signed, reaction, equilibrium)


def _partition(
    problem: Problem, boundary: BoundaryTrace, pairs: Sequence[ContactState], units: Units
) -> Partition:
    """The triangles of the mesh, those divided in whose corners given tractions meet."""
    uneven = [pair.line.facing for pair in pairs if pair.line.means.any()]
    facing: Index = np.concatenate([np.zeros(0, dtype=np.intp), *uneven])
    divided = divided_elements(problem, boundary, degree_for(boundary), facing)
    return partition_of(boundary, units.length, divided)


def _stress(
    discrete: Discrete,
    zones: Sequence[Zone],
    coefficients: Sequence[Array],
    raw: Array,
    certificate: dict[str, float],
    units: Units,
) -> EquilibratedStress:
    """The equilibrated stress in the units of the data; a ContactError if it is not."""
    if max(certificate.values()) > SETTLED:
        raise ContactError(
            "no equilibrated stress was found: the residuals relative to the largest stress are "
            f"{certificate}"
        )
    pressure = [
        ContactPressure(zone.state.line.segments, np.append(b, 0.0)[zone.number] * units.stress)
        for zone, b in zip(zones, coefficients, strict=True)
    ]
    unilateral = [not zone.state.line.contact.bilateral for zone in zones]
    chosen = [p.coefficients for p, one in zip(pressure, unilateral, strict=True) if one]
    least = min((float(c.min(initial=0.0)) for c in chosen), default=0.0)
    partition = discrete.partition
    return EquilibratedStress(
        degree=discrete.degree,
        triangles=partition.vertices[partition.triangles] * units.length,
        element=partition.parent,
        coefficients=raw * units.stress,
        pressure=pressure,
        certificate=certificate | {"least pressure": least},
    )


def _work_of_supports(fields: Sequence[EdgeField], partition: Partition, traction: Array) -> float:
    """Work of s n on u_D - u_h, `traction` (n, 3, r) on the edges of the triangles."""
    work = 0.0
    for field in fields:
        triangle, side = (x[field.edge] for x in partition.owner)
        t = traction[triangle, side].reshape(len(triangle), 2, -1)
        values = legendre_values(t.shape[2] - 1, field.t.ravel()).reshape(*field.t.shape, -1)
        density = np.einsum("kqi,kci,kqc->kq", values, t, field.value)
        work += float(partition.edge_lengths[field.edge] @ (field.weight * density).sum(axis=1))
    return work


@dataclass(frozen=True, eq=False)
class _Norms:
    """Norms (n,) on the triangles, by what they are of."""

    constitutive: Array
    loads: Array
    curves: Array
    lifting: Array


def _summed(
    units: Units,
    norms: _Norms,
    closed: float,
    signed: float,
    reaction: float,
    stress: EquilibratedStress,
) -> ErrorBound:
    """All parts together, in the units of the data.

    `closed` is the integral of p* (gap_h + r), `signed` that of p* gap_h, `reaction` the work of
    s n on u_D - u_h.
    """
    energy = units.stress**2 / units.modulus * units.length**2
    constitutive, lifting, loads = norms.constitutive, norms.lifting, norms.loads + norms.curves
    smooth = constitutive + norms.loads
    both = constitutive + loads
    parts = {
        "constitutive": float(constitutive @ constitutive),
        "complementarity": 2 * closed,
        "lifting": float(lifting @ lifting),
        "loads": float(smooth @ smooth - constitutive @ constitutive),
        "curves": float(both @ both - smooth @ smooth),
    }
    square = sum(parts.values())
    crossed = float(constitutive @ lifting)
    data = float(loads @ (constitutive + 2 * lifting) + loads @ loads / 2)
    below = parts["constitutive"] / 2 + signed - reaction + data
    above = crossed + reaction + closed - signed + parts["lifting"] / 2 + float(loads @ lifting)
    return ErrorBound(
        bound=math.sqrt(square) * units.stress / math.sqrt(units.modulus) * units.length,
        parts={name: part * energy for name, part in parts.items()},
        below=below * energy,
        above=above * energy,
        stress=stress,
    )


def _complementarity(gap: Gap, b: Array) -> tuple[float, float]:
    """Integrals of p* times the gap after lifting, and before."""
    zone, pieces = gap.zone, gap.pieces
    at = np.flatnonzero((zone.number[pieces.local] >= 0).any(axis=1))
    if at.size == 0:
        return 0.0, 0.0
    t, w = gap.panels(at)
    value, r, _ = gap.lifted(at, t)
    s = pieces.start[at, None] + (pieces.stop - pieces.start)[at, None] * t
    p = (zone.values(np.repeat(pieces.local[at], t.shape[1]), s.ravel()) @ b).reshape(t.shape)
    # ds or d eta per parameter; on curves no polynomial, but nearly
    stretch = coefficients(gap.points.weight.reshape(len(pieces.local), -1)[at])
    density = at_points(stretch, t) * w * p
    return float((density * (value + r)).sum()), float((density * value).sum())
