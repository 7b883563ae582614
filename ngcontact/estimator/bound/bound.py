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
from ...quadrature import features_of, unresolved
from .cells import Cells, cells_of
from .elements import Element, by_triangle, elements_of, rigid_motions
from .facing import TO_ENDS, facing_sides, guide_sides, held_motions, new_vertices, pressure_support
from .force_quadrature import ForceQuadrature, force_quadrature
from .lifting import Prescribed, lifted, prescribed_on_supports
from .oscillation import (
    EQUILIBRIUM_RESIDUAL,
    BalancedCells,
    balanced_again,
    oscillation_norms,
    residuals,
)
from .program import Balanced, DualProgram, dual_program
from .tractions import BoundaryData, boundary_data, rough_places, side_rule

NO_BOUND = "no guaranteed bound is known"
BESIDE_VERTICES = (0.1, 0.9)  # places beside vertices, where pressures have resultants near to them
LIFTING_DEGREES = 3  # degrees by which w is above u_h
# Part of modulus times displacement over size of an element: equilibrium is measured beside the
# round-off of such stresses.
NOTICEABLE_STRAIN = 1e-4


@dataclass(frozen=True, eq=False)
class AdmissibleStress(Balanced):
    """An admissible stress s on n triangles, compared with C e of a displacement u_h."""

    distance: Array  # (n,) |s - C e|, root of an energy per thickness
    loads: Array  # (n,) norms of what s misses of the data, the same
    work: float  # <s n, u_D - u_h> - int p* gap_h, an energy per thickness
    residual: float  # of equilibrium, relative to the largest stress


@dataclass(frozen=True, eq=False)
class DualProblem:
    """The dual contact problem on n cells, for the strain of a displacement."""

    cells: Cells
    given: BoundaryData
    prescribed: list[Prescribed]  # u_D - u_h
    elements: list[Element]
    rules: ForceQuadrature  # how forces are integrated
    moments: Array  # (d,) of the given tractions with the multipliers
    program: DualProgram

    def admissible(
        self,
        displacement: ng.GridFunction,
        found: Balanced,
        least: float = 0.0,
        degree: int | None = None,
    ) -> AdmissibleStress:
        """The stress `found` as an admissible one, with its distance from C e of u_h.

        Residuals are relative to the largest stress, which counts as `least` at the least. Where s
        misses much of the data, stresses of more than a `degree` are balanced again.

        Raises
        ------
        ContactError
            It is not in equilibrium.
        """
        cells, elements, lines = self.cells, self.elements, self.program.lines
        given = self.given.with_pressure(lines, found.pressure)
        distance, largest = found.s.norms()
        scale = max(largest, least)
        residual = float(residuals(cells, self.program.multipliers, found.unbalanced, scale).max())
        if not residual <= EQUILIBRIUM_RESIDUAL:
            raise ContactError(
                f"no equilibrated stress was found: the residual relative to the largest stress is "
                f"{residual:.1e}"
            )
        rule = side_rule(cells, given.breaks, np.flatnonzero(~cells.inner))
        at = cells.owner[rule.side]
        have = found.s.tractions(at, rule.x, rule.normal)
        missed = rule.missed(cells, given.tractions(cells, rule, have) - have, scale)
        loads = oscillation_norms(cells, elements, missed)
        if degree is not None:
            level = BalancedCells(cells, found.s, self.rules, distance, loads)
            distance, loads = balanced_again(displacement, given, level, degree, scale)
        if not np.isfinite(loads).all():
            raise ValueError(
                "no guaranteed bound is known for loads that are no polynomials beside the axis; "
                "use error_estimate"
            )
        work = sum(rule.work(have, one.side, one.direction, one.amount) for one in self.prescribed)
        for line, p in zip(lines, found.pressure, strict=True):
            work -= float((line.force(p) * line.gap).sum())
        return AdmissibleStress(
            s=found.s,
            pressure=found.pressure,
            unbalanced=found.unbalanced,
            free_force=found.free_force,
            distance=distance,
            loads=loads,
            work=work,
            residual=residual,
        )


@dataclass(frozen=True, eq=False)
class Proof:
    """Everything that a bound was computed from."""

    dual: DualProblem
    stress: AdmissibleStress  # the nearest one, and p* >= 0
    lifting: Array  # (n,) norms of w
    parts: dict[str, float]  # what B^2 is the sum of
    # L(u_h) - below <= L(u) <= L(u_h) + above, energies per thickness
    below: float
    above: float

    @property
    def bound(self) -> float:
        """B, root of an energy per thickness."""
        return float(sum(self.parts.values()) ** 0.5)


def error_bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
) -> Proof:
    """Bound of the error of a displacement u_h, lengths, in the energy norm.

    `trace` is the boundary of its mesh, `pairs` are its contact, one for each pair of the problem.

    Raises
    ------
    ValueError
        A problem for which no bound is known.
    ContactError
        No equilibrated stress.
    """
    refuse_bound(problem, trace, pairs)
    for one in unresolved(problem, trace.mesh, in_bounds=True):
        raise ValueError(f"{NO_BOUND} where {one}; refine the mesh there")
    try:
        return _bound(problem, trace, displacement, pairs, ())
    except ContactError:  # resultants that no polynomial pressure has, as of a body about to tilt
        return _bound(problem, trace, displacement, pairs, BESIDE_VERTICES)


def _bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
    beside: Sequence[float],
) -> Proof:
    """The bound in the steps of docs/bounds.md; p* also has breaks `beside` ends of segments."""
    p, extent = trace.order, trace.model.extent
    degree, lift = max(p + 1, 2 + extent), p + LIFTING_DEGREES
    # 1. Cells.
    guided = trace.segments(None if problem.sliding is None else str(problem.sliding))
    guided = guided[~trace.on_axis[guided]]  # the axis guides by itself: there u_r = 0
    touching = [name for pair in problem.contact for name in (pair.secondary, pair.primary)]
    loaded = np.append(trace.segments(*problem.traction, *touching), guided)
    whole = [name for name, values in problem.displacement.items() if None not in values]
    reaches = [pressure_support(trace, displacement, pair, lift) for pair in pairs]
    cuts = rough_places(problem, trace) | new_vertices(trace, reaches, beside)
    cells = cells_of(trace, cuts, loaded, trace.segments(*whole))
    # 2. Stresses.
    given = boundary_data(problem, cells)
    rules = force_quadrature(problem, cells, degree, np.maximum(given.followed(), cells.curved))
    mu, elements = elements_of(problem, cells, displacement, degree, rules)
    # 3. The gap, on guides and on Gamma_K.
    prescribed = prescribed_on_supports(cells, given, displacement)
    lines, side = [], np.flatnonzero(np.isin(cells.segment, guided))
    for k in np.unique(mu.degree[side]).tolist():
        own = side[mu.degree[side] == k]
        lines.append(guide_sides(cells, displacement, own, (k - extent, lift)))
    holding = [(x.side, x.direction[:, [0, -1]]) for x in prescribed]
    held = held_motions(cells, holding + [(x.side, TO_ENDS @ x.direction) for x in lines])
    moduli = by_triangle(elements, [e.modulus for e in elements])
    for reach in reaches:
        degrees = degree - extent, lift
        lines.append(facing_sides(cells, displacement, reach, degrees, held, moduli))
    every = np.arange(len(trace.region))
    sizes = [trace.evaluate(displacement, every, np.zeros(len(every)))]
    size = max(float(np.abs(x).max(initial=0.0)) for x in sizes + [x.gap for x in lines])
    # 4. w, before a factor takes memory.
    w = lifted(problem, cells, prescribed, [(line, line.lift) for line in lines], lift, size)
    # The dual problem: s and p*.
    moments, fixed = given.moments(mu)
    program = dual_program(mu, elements, fixed, rigid_motions(cells, mu, fixed), lines)
    dual = DualProblem(cells, given, prescribed, elements, rules, moments, program)
    stiffest = min(np.diagonal(e.compliance, axis1=-2, axis2=-1).min() for e in elements)
    felt = NOTICEABLE_STRAIN * size / float(stiffest * cells.diameters.min())
    stress = dual.admissible(displacement, program.nearest(elements, moments), felt, degree)
    # The identity.
    c, D = stress.distance, stress.loads
    closed = float(sum((p * x.bound).sum() for p, x in zip(stress.pressure, lines, strict=True)))
    parts = {
        "constitutive": float(c @ c),
        "complementarity": 2 * closed,
        "lifting": float(w @ w),
        "loads": float(D @ (2 * c + D)),
    }
    # What holds free motions does work on u_h, of which L(u_h) does not tell.
    idle = stress.free_force and stress.free_force * largest(elements, cells, displacement)
    below = float(c @ c / 2 + D @ (c + D / 2 + 2 * w)) - stress.work + idle
    above = float((c + D + w / 2) @ w) + stress.work + closed + idle
    return Proof(dual, stress, lifting=w, parts=parts, below=below, above=above)


def largest(elements: Sequence[Element], cells: Cells, function: ng.CoefficientFunction) -> float:
    """The largest component of a function at points of quadrature."""
    return max(float(np.abs(e.places.evaluate(cells, function)).max()) for e in elements)


def refuse_bound(problem: Problem, trace: BoundaryTrace, pairs: Sequence[ContactState]) -> None:
    """Raise unless the error of a problem's solutions can be bounded.

    Raises
    ------
    ValueError
        What stands in the way.
    """
    problem.refuse_solids("a guaranteed bound")
    bent = trace.curved_segments
    axis = trace.model.on_axis(trace.curve[:, [0, -1]].reshape(-1, 2)).reshape(-1, 2)
    for refused, what in (
        (bent & trace.inner, "curved lines inside a body"),
        (bent & axis.any(axis=1), "curves that meet the axis"),
    ):
        if refused.any():
            name = trace.mesh.GetBoundaries()[trace.region[refused.argmax()]]
            raise ValueError(f'{NO_BOUND} for {what}, as "{name}"; use error_estimate')
    guides = () if problem.sliding is None else (str(problem.sliding),)
    for pattern in (*problem.displacement, *problem.traction, *guides):
        if trace.inner[trace.segments(pattern)].any():
            raise ValueError(
                f'{NO_BOUND} for conditions on a line inside a body, as on "{pattern}"'
            )
    for line, force in ((pair.line, pair.force) for pair in pairs):
        loaded = (np.append(force, 0.0)[line.rows] != 0).any(axis=1)
        ends = np.isin(line.rows, [-1, *line.rows[line.faces].ravel()]).all(axis=1)
        if line.contact.primary is None and (loaded & ~line.faces & ~ends).any():
            name = line.contact.secondary
            raise ValueError(
                f'{NO_BOUND} for segments that face an obstacle in part, as on "{name}"'
            )
    for one in features_of(problem, trace.mesh):
        for x, y, _ in one.jumps.tolist():
            raise ValueError(
                f'the displacement prescribed on "{one.name}" jumps near ({x:.6g}, {y:.6g}): '
                "no displacement of finite energy does; make it continuous, or leave a gap between "
                "boundaries"
            )
