"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, the pressure p* >= 0 on Gamma_K, and w that corrects
what u_h misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w. See docs/bounds.md for the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...contact import ContactState
from ...fem import BoundaryTrace
from ...problem import Problem
from .constants import data_terms
from .liftings import EdgeField, Gap, at_points, gap_of, lifted, on_contact, on_supports, panels
from .pressures import Zone, selected, zone_of
from .refusals import refuse_bound
from .stress import ContactPressure, EquilibratedStress, certified
from .stresses import (
    Partition,
    Units,
    degree_for,
    discrete_on,
    divided_elements,
    edge_conditions,
    equilibrated,
    legendre_values,
    partition_of,
    units_of,
)


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
        Loads that no pressure balances.
    """
    refuse_bound(problem, boundary, pairs)
    units = units_of(problem, boundary, stress)
    divided = divided_elements(problem, boundary, degree_for(boundary.order))
    partition = partition_of(boundary, units.length, divided)
    discrete = discrete_on(problem, partition, boundary.order, stress, units)
    conditions = edge_conditions(problem, boundary, partition, discrete.degree, units.stress)
    zones = [zone_of(pair, boundary, discrete.degree - 1) for pair in pairs]
    gaps = [gap_of(zone, boundary, displacement, units) for zone in zones]
    discrete, given, coefficients = selected(
        zones, boundary, displacement, stress, discrete, conditions, units
    )
    result = equilibrated(discrete, conditions, given)
    raw, traction, certificate = certified(discrete, conditions, given, result)
    fields = on_supports(problem, boundary, displacement, discrete, units)
    others = [
        x for zone, gap in zip(zones, gaps, strict=True) for x in on_contact(zone, gap, discrete)
    ]
    closed, signed = 0.0, 0.0
    for zone, gap, b in zip(zones, gaps, coefficients, strict=True):
        part = _complementarity(zone, gap, b)
        closed, signed = closed + part[0], signed + part[1]
    reaction = _work_of_supports(fields, partition, traction)
    pressure = [
        ContactPressure(zone.state.line.segments, np.append(b, 0.0)[zone.number] * units.stress)
        for zone, b in zip(zones, coefficients, strict=True)
    ]
    equilibrium = EquilibratedStress(
        degree=discrete.degree,
        triangles=partition.vertices[partition.triangles] * units.length,
        element=partition.parent,
        coefficients=raw * units.stress,
        pressure=pressure,
        certificate=certificate | {"least pressure": _least(pressure)},
    )
    constitutive = np.linalg.norm(result.change, axis=1)
    loads = data_terms(partition, discrete.law, discrete.missed, conditions.missed)
    lifting = lifted(discrete, fields, others)
    return _summed(units, constitutive, loads, lifting, closed, signed, reaction, equilibrium)


def _least(pressures: Sequence[ContactPressure]) -> float:
    """The least coefficient of p*, 0 without contact."""
    return min((float(p.coefficients.min(initial=0.0)) for p in pressures), default=0.0)


def _work_of_supports(fields: Sequence[EdgeField], partition: Partition, traction: Array) -> float:
    """Work of s n on u_D - u_h, `traction` (n, 3, r) on the edges of the triangles."""
    work = 0.0
    for field in fields:
        triangle, side = (x[field.edge] for x in partition.owner)
        t = traction[triangle, side].reshape(len(triangle), 2, -1)
        values = legendre_values(t.shape[2] - 1, field.t.ravel()).reshape(*field.t.shape, -1)
        density = np.einsum("kqi,kci,kqc->kq", values, t, field.value, optimize=True)
        work += float(partition.edge_lengths[field.edge] @ (field.weight * density).sum(axis=1))
    return work


def _summed(
    units: Units,
    constitutive: Array,
    loads: Array,
    lifting: Array,
    closed: float,
    signed: float,
    reaction: float,
    stress: EquilibratedStress,
) -> ErrorBound:
    """All parts together, in the units of the data.

    `constitutive`, `loads`, `lifting` (n,) are norms on the triangles; `closed` is the integral of
    p* (gap_h + r), `signed` that of p* gap_h, `reaction` the work of s n on u_D - u_h.
    """
    energy = units.stress**2 / units.modulus * units.length**2
    both = constitutive + loads
    parts = {
        "constitutive": float(constitutive @ constitutive),
        "complementarity": 2 * closed,
        "lifting": float(lifting @ lifting),
        "loads": float(both @ both - constitutive @ constitutive),
        "curves": 0.0,
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


def _complementarity(zone: Zone, gap: Gap, b: Array) -> tuple[float, float]:
    """Integrals of p* times the gap after lifting, and before."""
    carries = (zone.number[gap.local] >= 0).any(axis=1)
    at = np.flatnonzero(carries)
    if at.size == 0:
        return 0.0, 0.0
    local, c = gap.local[at], gap.values[at]
    closed = zone.full[local] | zone.state.line.contact.bilateral
    s, w = panels(np.where(closed[:, None], 0.0, c))
    p = (zone.values(np.repeat(local, s.shape[1]), s.ravel()) @ b).reshape(s.shape)
    shape = len(gap.local), -1
    length = gap.points.weight.reshape(shape)[at, :1]  # ds per parameter of a straight segment
    value = at_points(c, s)
    open_ = np.where(closed[:, None], 0.0, np.maximum(value, 0.0))
    density = length * w * p
    return float((density * open_).sum()), float((density * value).sum())
