"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, p* >= 0 on Gamma_K, and w that corrects what u_h
misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w; docs/bounds.md has the proof. s and p* minimise B^2:
they solve the dual contact problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...contact import ContactState
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...problem import Problem
from .cells import Cells, cells_of, places
from .elements import (
    Element,
    compliance_at,
    elements_of,
    rigid_motions,
    stress_norms,
)
from .facing import PLACES, Facing, bernstein, cuts_of, facing_of, guides_of, held_motions, reach_of
from .lifting import asked_on_line, asked_on_supports, lifted
from .missed import SETTLED, Level, data_norms, once_more, residuals
from .parts import ForceRules, force_rules
from .program import Balanced, DualProgram, dual_program, rows_of
from .refusals import refuse_bound, refuse_narrow
from .tractions import Given, boundary_tractions, given_on

BESIDE = (0.1, 0.9)  # places beside vertices, where pressures have resultants near to them
LIFTED = 3  # degrees by which w is above u_h
# Part of modulus times displacement over size of an element: equilibrium is measured beside the
# round-off of such stresses.
FELT = 1e-4


@dataclass(frozen=True, eq=False)
class AdmissibleStress(Balanced):
    """A stress s in equilibrium on n triangles, beside C e of a displacement u_h.

    Attributes
    ----------
    distance : ndarray (n,)
        |s - C e|, roots of energies per thickness.
    loads : ndarray (n,)
        Norms of what s misses of the data.
    work : float
        <s n, u_D - u_h> - int p* gap_h, an energy per thickness.
    residual : float
        Of equilibrium, relative to the largest stress.
    """

    distance: Array
    loads: Array
    work: float
    residual: float


@dataclass(frozen=True, eq=False)
class DualProblem:
    """Conditions on n cells, and their program for the strain of a displacement.

    Attributes
    ----------
    cells : Cells
    given : Given
    elements : list of Element
    rules : ForceRules
        How forces are integrated.
    moments : ndarray (d,)
        Of the given tractions with the multipliers.
    program : DualProgram
    """

    cells: Cells
    given: Given
    elements: list[Element]
    rules: ForceRules
    moments: Array
    program: DualProgram

    def admissible(
        self,
        displacement: ng.GridFunction,
        found: Balanced,
        least: float = 0.0,
        degree: int | None = None,
    ) -> AdmissibleStress:
        """What a stress `found` proves of a displacement u_h, under the given loads.

        Equilibrium is measured beside the largest stress, `least` or more. Where s misses much of
        the data, stresses above a `degree` are sought once more.

        Raises
        ------
        ContactError
            It is not in equilibrium.
        """
        cells, elements, lines = self.cells, self.elements, self.program.lines
        given = self.given.under(lines, found.pressure)
        distance, largest = stress_norms(elements, found.coefficients)
        scale = max(largest, least)
        residual = float(residuals(cells, self.program.multipliers, found.left, scale).max())
        if not residual <= SETTLED:
            raise ContactError(
                f"no equilibrated stress was found: the residual relative to the largest stress is "
                f"{residual:.1e}"
            )
        have = boundary_tractions(given, elements, found.coefficients)
        missed = have.missed(given, scale)
        loads = data_norms(cells, elements, missed)
        if degree is not None:
            level = Level(cells, elements, found.coefficients, self.rules, distance, loads)
            distance, loads = once_more(displacement, given, level, degree, scale)
        if not np.isfinite(loads).all():
            raise ValueError(
                "no guaranteed bound is known for loads that are no polynomials beside the axis; "
                "use error_estimate"
            )
        work = have.work(given, displacement)
        for line, p in zip(lines, found.pressure, strict=True):
            work -= work_on_gap(line.facing, p, line.facing.gap)
        balanced = found.coefficients, found.pressure, found.left
        return AdmissibleStress(*balanced, distance, loads, work, residual)


@dataclass(frozen=True, eq=False)
class Proof(DualProblem):
    """What a bound was made of.

    Attributes
    ----------
    stress : AdmissibleStress
        The nearest one, and p* >= 0.
    lifting : ndarray (n,)
        Norms of w.
    parts : dict of float
        What B^2 is the sum of.
    below, above : float
        L(u_h) - below <= L(u) <= L(u_h) + above, energies per thickness.
    """

    stress: AdmissibleStress
    lifting: Array
    parts: dict[str, float]
    below: float
    above: float

    @property
    def bound(self) -> float:
        """B, root of an energy per thickness."""
        return float(sum(self.parts.values()) ** 0.5)

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
    rules = force_rules(problem, cells, degree, least)
    mu, elements = elements_of(problem, cells, displacement, degree, rules)
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
    dual = DualProblem(cells, given, elements, rules, moments, program)
    every = np.arange(len(trace.region))
    sizes = [trace.evaluate(displacement, every, np.zeros(len(every)))]
    size = max(float(np.abs(x).max(initial=0.0)) for x in sizes + [x.facing.gap for x in lines])
    stiffest = min(np.diagonal(e.compliance, axis1=-2, axis2=-1).min() for e in elements)
    felt = FELT * size / float(stiffest * cells.diameters.min())
    found = program.nearest(elements, moments)
    stress = dual.admissible(displacement, found, felt, degree)
    lifts = [(line.facing, line.facing.lift) for line in lines]
    lifting = lifted(problem, cells, asked, lifts, lift, size)
    c, D = stress.distance, stress.loads
    closed = float(sum((p * x.bound).sum() for p, x in zip(stress.pressure, lines, strict=True)))
    parts = {
        "constitutive": float(c @ c),
        "complementarity": 2 * closed,
        "lifting": float(lifting @ lifting),
        "loads": float(D @ (2 * c + D)),
    }
    below = float(c @ c / 2 + D @ (c + D / 2 + 2 * lifting)) - stress.work
    above = float((c + D + lifting / 2) @ lifting) + stress.work + closed
    return Proof(
        **vars(dual), stress=stress, lifting=lifting, parts=parts, below=below, above=above
    )


def work_on_gap(facing: Facing, pressure: Array, gap: Array) -> float:
    """Integral of a pressure on a line times a gap, an energy per thickness.

    `pressure` (k, n) has Bernstein coefficients on its k sides, `gap` (k, j) lengths at `PLACES`.
    """
    density = pressure @ bernstein(pressure.shape[1] - 1, PLACES).T * facing.weight
    return float((density * gap).sum())


def _share(problem: Problem, cells: Cells, pair: ContactState) -> float:
    """The share of r that the secondary takes: by compliance."""
    sizes = []
    for segments in (pair.line.segments, pair.line.facing):
        at = cells.owner[np.isin(cells.segment, segments)][:1]
        if not at.size:
            return 1.0
        sizes.append(np.trace(compliance_at(problem, cells, places(cells, at, 0))[0, 0]))
    return float(sizes[0] / sum(sizes))
