"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, p* >= 0 on Gamma_K, and w that corrects what u_h
misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w; docs/bounds.md has the proof. s and p* minimise B^2:
they solve the dual contact problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...contact import ContactState
from ...errors import ContactError
from ...fem import BoundaryTrace, narrow_forces
from ...problem import Problem
from .cells import Cells, cells_of, places
from .elements import (
    ON_CURVES,
    PARTED,
    WHOLE,
    Element,
    Multipliers,
    compliance_at,
    elements_of,
    rigid_motions,
)
from .facing import PLACES, Facing, bernstein, cuts_of, facing_of, guides_of, held_motions, reach_of
from .lifting import asked_on_line, asked_on_supports, lifted
from .missed import Level, data_norms, once_more
from .norms import (
    SETTLED,
    StressNorms,
    forces_missed,
    residuals,
    smallest_moduli,
    stress_norms,
)
from .parts import LEVELS
from .program import Balanced, DualProgram, dual_program, rows_of
from .refusals import refuse_bound, refuse_narrow
from .tractions import Given, boundary_tractions, given_on

BESIDE = (0.1, 0.9)  # places beside vertices, where pressures have resultants near to them
LIFTED = 3  # degrees by which w is above u_h
FELT = 1e-4  # of modulus times displacement over an element's size: stresses beside whose round-off
# equilibrium is measured


@dataclass(frozen=True, eq=False)
class Proof:
    """What a bound was made of.

    Attributes
    ----------
    cells : Cells
        The mesh of the stress, n triangles.
    multipliers : Multipliers
    elements : list of Element
    given : Given
    moments : ndarray (d,)
        Of the given tractions with the multipliers.
    program : DualProgram
    balanced : Balanced
        The stress in equilibrium, and p*.
    stress : StressNorms
    loads : ndarray (n,)
        Norms of what s misses of the data.
    lifting : ndarray (n,)
        Norms of w.
    bound : float
        B, root of an energy per thickness.
    parts : dict of float
        What B^2 is the sum of.
    below, above : float
        L(u_h) - below <= L(u) <= L(u_h) + above, energies per thickness.
    residual : float
        Of equilibrium, relative to the largest stress.
    """

    cells: Cells
    multipliers: Multipliers
    elements: list[Element]
    given: Given
    moments: Array
    program: DualProgram
    balanced: Balanced
    stress: StressNorms
    loads: Array
    lifting: Array
    bound: float
    parts: dict[str, float]
    below: float
    above: float
    residual: float

    @property
    def sampled(self) -> bool:
        """Whether quadrature of the stiffness is not exact: curves, or laws that vary."""
        return bool(self.cells.curved.any()) or any(e.compliance.size > 16 for e in self.elements)


def error_bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
) -> Proof:
    """Bound of the error of a displacement in the energy norm.

    Parameters
    ----------
    problem : Problem
    trace : BoundaryTrace
        The boundary of its mesh.
    displacement : ng.GridFunction
        u_h, lengths.
    pairs : sequence of ContactState
        Contact of u_h, one for each pair of the problem.

    Raises
    ------
    ValueError
        A problem for which no bound is known.
    ContactError
        No equilibrated stress.
    """
    refuse_bound(problem, trace, pairs)
    refuse_narrow(problem, trace)
    try:
        return _bound(problem, trace, displacement, pairs, ())
    except ContactError:  # resultants that no polynomial pressure has, as of a body about to tilt
        return _bound(problem, trace, displacement, pairs, BESIDE)


def _bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
    beside: Sequence[float],
) -> Proof:
    """The bound with a p* that is one polynomial between places `beside` ends of segments."""
    p, extent = trace.order, trace.model.extent
    degree, lift = max(p + 1, 2 + extent), p + LIFTED
    reaches = [reach_of(trace, displacement, pair, lift) for pair in pairs]
    touching = [name for pair in problem.contact for name in (pair.secondary, pair.primary)]
    guided = None if problem.sliding is None else str(problem.sliding)
    loaded = trace.segments(*problem.traction, guided, *touching)
    whole = [name for name, values in problem.displacement.items() if None not in values]
    cells = cells_of(trace, cuts_of(trace, reaches, beside), loaded, trace.segments(*whole))
    given = given_on(problem, cells)
    least = np.maximum(given.followed(), cells.curved)
    narrow = narrow_forces(problem, trace.mesh, p)[cells.parent]
    depth = np.maximum(least, LEVELS * narrow)
    order = 2 * (degree + ON_CURVES * cells.curved) + np.where(depth, PARTED, WHOLE)
    look = np.column_stack([order, depth, least > 0])
    mu, elements = elements_of(problem, cells, displacement, degree, look)
    asked = asked_on_supports(cells, given, displacement)
    of_guides = mu.degree[given.guides]
    guides = [
        (k, guides_of(cells, displacement, given.guides[of_guides == k], lift))
        for k in np.unique(of_guides).tolist()
    ]
    holding = [*asked, *(x for _, g in guides for x in asked_on_line(g, g.gap, alone=True))]
    held = held_motions(cells, [x.side for x in holding], [x.direction for x in holding])
    lines = [rows_of(mu, guide, k - extent) for k, guide in guides]
    for reach in reaches:
        share = _share(problem, cells, reach.pair)
        facing = facing_of(cells, displacement, reach, lift, held, share)
        lines.append(rows_of(mu, facing, degree - extent))
    moments, fixed = given.moments(mu)
    motions = rigid_motions(cells, mu, fixed)
    program = dual_program(mu, elements, fixed, motions, lines)
    balanced = program.nearest(elements, moments)
    n = len(cells.triangles)
    stress = stress_norms(elements, balanced.coefficients, n)
    gaps = [float(np.abs(line.facing.gap).max(initial=0.0)) for line in lines]
    extent_of_u = max(_size(trace, displacement), *gaps, 0.0)
    scale = max(stress.largest, FELT * _stiffest(elements) * extent_of_u / cells.diameters.min())
    left = program.unbalanced(mu, elements, moments, balanced)
    residual = float(residuals(cells, mu, left, scale).max())
    if not residual <= SETTLED:
        raise ContactError(
            f"no equilibrated stress was found: the residual relative to the largest stress is "
            f"{residual:.1e}"
        )
    given = given.under(lines, balanced.pressure)
    have = boundary_tractions(given, elements, balanced.coefficients)
    missed = have.missed(given, scale)
    loads = data_norms(cells, forces_missed(elements, n), missed, smallest_moduli(elements, n))
    level = Level(cells, elements, balanced.coefficients, look, stress.distance, loads)
    distance, loads = once_more(problem, displacement, given, level, degree, scale)
    stress = replace(stress, distance=distance)
    if not np.isfinite(loads).all():
        raise ValueError(
            "no guaranteed bound is known for loads that are no polynomials beside the axis; use "
            "error_estimate"
        )
    lifts = [(line.facing, line.facing.lift) for line in lines]
    lifting = lifted(problem, cells, asked, lifts, lift, extent_of_u)
    closed, signed = 0.0, 0.0
    for line, pressure in zip(lines, balanced.pressure, strict=True):
        closed += float((pressure * line.bound).sum())
        signed += work_on_gap(line.facing, pressure, line.facing.gap)
    parts, below, above = _summed(
        stress.distance, loads, lifting, closed, signed, have.work(given, displacement)
    )
    return Proof(
        cells=cells,
        multipliers=mu,
        elements=elements,
        given=given,
        moments=moments,
        program=program,
        balanced=balanced,
        stress=stress,
        loads=loads,
        lifting=lifting,
        bound=sum(parts.values()) ** 0.5,
        parts=parts,
        below=below,
        above=above,
        residual=residual,
    )


def _summed(
    constitutive: Array,
    loads: Array,
    lifting: Array,
    closed: float,
    signed: float,
    reaction: float,
) -> tuple[dict[str, float], float, float]:
    """The parts of B^2, and how far the energy is below and above that of u_h.

    `closed` is the integral of p* (gap_h + r), `signed` that of p* gap_h, `reaction` the work of
    s n on u_D - u_h.
    """
    both, own = constitutive + loads, float(constitutive @ constitutive)
    parts = {
        "constitutive": own,
        "complementarity": 2 * closed,
        "lifting": float(lifting @ lifting),
        "loads": float(both @ both) - own,
    }
    worked = float(loads @ lifting)
    data = float(loads @ constitutive + loads @ loads / 2) + 2 * worked
    below = own / 2 + signed - reaction + data
    above = float(constitutive @ lifting) + reaction + closed - signed
    return parts, below, above + parts["lifting"] / 2 + worked


def work_on_gap(facing: Facing, pressure: Array, gap: Array) -> float:
    """Integral of a pressure on a line times a gap, an energy per thickness.

    `pressure` (k, n) has Bernstein coefficients on its k sides, `gap` (k, j) lengths at `PLACES`.
    """
    density = pressure @ bernstein(pressure.shape[1] - 1, PLACES).T * facing.weight
    return float((density * gap).sum())


def _stiffest(elements: Sequence[Element]) -> float:
    """The largest modulus, a stress: one over the least diagonal entry of C^-1."""
    return max(1 / float(np.diagonal(e.compliance, axis1=-2, axis2=-1).min()) for e in elements)


def _share(problem: Problem, cells: Cells, pair: ContactState) -> float:
    """The share of r that the secondary takes: by compliance."""
    sizes = []
    for segments in (pair.line.segments, pair.line.facing):
        at = cells.owner[np.isin(cells.segment, segments)][:1]
        if not at.size:
            return 1.0
        sizes.append(np.trace(compliance_at(problem, cells, places(cells, at, 0))[0, 0]))
    return float(sizes[0] / sum(sizes))


def _size(trace: BoundaryTrace, displacement: ng.GridFunction) -> float:
    """The largest displacement at a vertex of the boundary, a length."""
    every = np.arange(len(trace.region))
    return float(np.abs(trace.evaluate(displacement, every, np.zeros(len(every)))).max())
