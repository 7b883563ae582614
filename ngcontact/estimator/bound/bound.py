"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, p* >= 0 on Gamma_K, and w that corrects what u_h
misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w; docs/bounds.md has the proof. s and p* minimise B^2: they
are the solution of the dual contact problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...contact import ContactState
from ...errors import ContactError, ConvergenceError
from ...fem import BoundaryTrace
from ...lagrange import lagrange_derivative
from ...problem import Problem
from .cells import Cells, cells_of, places
from .elements import Element, Multipliers, compliance_at, rigid_motions
from .elements import elements as elements_of
from .facing import (
    DATA,
    PLACES,
    ROUND_OFF,
    THROUGH,
    WEIGHTS,
    Facing,
    bernstein,
    cuts_of,
    facing_of,
    guides_of,
    held_motions,
)
from .lifting import NOISE, _carried, _inverse, asked_on_contact, asked_on_supports, lifting_of
from .missed import data_norms, least_moduli, missed_tractions, tractions_of
from .program import Rows, Solved, rows_of, solved
from .rough import on_pieces
from .tractions import given_on, moments_of

LIFTED = 3  # degrees by which w is above u_h
# What is missed of forces is looked at in so many pieces of each side, where it is more than this
# share of the mean error of a triangle, on so many triangles at most.
PARTS = ((4, 0.05, 4000), (16, 0.3, 200))
BESIDE = (0.1, 0.9)  # places beside vertices, where pressures have resultants near to them
SETTLED = 1e-10  # residual of equilibrium, relative to the largest stress


@dataclass(frozen=True, eq=False)
class Proof:
    """What a bound was made of."""

    cells: Cells
    mu: Multipliers
    elements: Sequence[Element]
    lines: Sequence[Rows]
    found: Solved
    coefficients: Sequence[Array]
    bound: float
    parts: dict[str, float]
    below: float
    above: float


def error_bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
    order: int,
    degree: int | None = None,
) -> Proof:
    """Bound of the error of a displacement in the energy norm.

    Raises
    ------
    ContactError
        No pressures balance the loads, or no stress was found.
    """
    data = problem, trace, displacement, pairs, order, degree
    for beside in ((), BESIDE):
        try:
            return _bound(*data, beside)
        except ConvergenceError:
            continue
    raise ContactError(
        "no pressures of one sign on the segments in contact balance the loads: give a finer mesh "
        "where contact holds a body"
    )


def _bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
    order: int,
    degree: int | None,
    beside: Sequence[float],
) -> Proof:
    """The same with more vertices `beside` those of the segments of Gamma_K."""
    extent = trace.model.extent
    degree = max(order + 1, 2 + extent) if degree is None else degree
    cuts, ends = cuts_of(trace, displacement, pairs, beside)
    sides = [(pair.secondary, pair.primary) for pair in problem.contact]
    loaded = trace.segments(*problem.traction, problem.sliding, *sum(sides, ()))
    whole = [name for name, u in problem.displacement.items() if None not in u]
    cells = cells_of(trace, cuts, loaded, trace.segments(*whole))
    mu, elements = elements_of(problem, cells, displacement, degree)
    given = given_on(problem, cells)
    asked = asked_on_supports(problem, cells, displacement)
    lines = []
    for k in np.unique(mu.degree[given.guides]).tolist():
        side = given.guides[mu.degree[given.guides] == k]
        guide = guides_of(cells, displacement, side, order + LIFTED)
        lines.append(rows_of(mu, guide, k - extent))
    holding = [*asked, *(one for line in lines for one in asked_on_contact(line.facing, True))]
    held = held_motions(cells, [x.side for x in holding], [x.direction for x in holding])
    for pair, end in zip(pairs, ends, strict=True):
        share = _share(problem, cells, pair)
        facing = facing_of(cells, displacement, pair, end, order + LIFTED, held, share)
        lines.append(rows_of(mu, facing, degree - extent))
    moments, fixed = moments_of(problem, cells, mu, given)
    motions = rigid_motions(cells, mu, fixed)
    found = solved(mu, elements, moments, fixed, motions, lines)
    return _summed(problem, cells, displacement, mu, elements, lines, found, given, asked, order)


def _summed(problem, cells, displacement, mu, elements, lines, found, given, asked, order) -> Proof:
    n = len(cells.triangles)
    constitutive, forces = np.zeros((2, n))
    coefficients, largest = found.coefficients, 0.0
    for e, c in zip(elements, coefficients, strict=True):
        s, D = e.full_stress(c), e.compliance
        off = (D @ s[..., None])[..., 0] - e.strain
        both = off * (np.linalg.inv(D) @ off[..., None])[..., 0]
        constitutive[e.places.at] = np.sqrt((e.weight * both.sum(axis=2)).sum(axis=1))
        forces[e.places.at] = e.missed
        largest = max(largest, float(np.abs(s).max()))
    residual = _residual(cells, mu, found)
    if residual > SETTLED * largest:
        raise ContactError(
            "no equilibrated stress was found: residuals relative to the largest stress are "
            f"{residual / largest:.1e}"
        )
    missed, reaction = _missed(
        problem, cells, displacement, elements, coefficients, lines, found, given, largest
    )
    least = least_moduli(cells, elements)
    loads = data_norms(cells, forces, missed, least)
    mean = float(np.linalg.norm(constitutive)) / n**0.5
    on_sides = data_norms(cells, 0 * forces, missed, least)
    for parts, worth, most in PARTS:
        costly = np.argsort(on_sides - loads)[:most]
        costly = costly[(loads - on_sides)[costly] > worth * mean]
        for e in elements:
            some = np.flatnonzero(np.isin(e.places.at, costly) & (e.missed > 0))
            if some.size:
                at = e.places.at[some]
                looked = on_pieces(problem, cells, e, some, parts) + on_sides[at]
                loads[at] = np.minimum(loads[at], looked)
    segment = np.arange(len(cells.trace.region))
    size = np.abs(cells.trace.evaluate(displacement, segment, np.zeros(len(segment)))).max()
    gaps = [np.abs(line.facing.gap).max(initial=0.0) for line in lines]
    gaps.append(ROUND_OFF * np.abs(cells.vertices).max() / NOISE)
    lifting = _lifted(problem, cells, asked, lines, order + LIFTED, max(float(size), *gaps))
    closed = signed = 0.0
    for line, p in zip(lines, found.pressure, strict=True):
        closed += float((p * line.bound).sum())
        density = p @ bernstein(p.shape[1] - 1, PLACES).T * line.facing.weight
        signed += float((density * line.facing.gap).sum())
    squares = float(((constitutive + loads) ** 2).sum())
    parts = {
        "constitutive": float(constitutive @ constitutive),
        "complementarity": 2 * closed,
        "lifting": float(lifting @ lifting),
        "loads": squares - float(constitutive @ constitutive),
    }
    crossed, worked = float(constitutive @ lifting), float(loads @ lifting)
    data = float(loads @ constitutive + loads @ loads / 2) + 2 * worked
    below = parts["constitutive"] / 2 + signed - reaction + data
    above = crossed + reaction + closed - signed + parts["lifting"] / 2 + worked
    bound = (squares + 2 * closed + parts["lifting"]) ** 0.5
    return Proof(cells, mu, elements, lines, found, coefficients, bound, parts, below, above)


def _residual(cells: Cells, mu: Multipliers, found: Solved) -> float:
    """The largest traction that does not balance."""
    x, dx = cells.points(np.arange(len(cells.ends)), np.full(len(cells.ends), 0.5))
    ds = np.linalg.norm(dx, axis=1) * cells.trace.model.measure(x)
    size = np.where(ds > 0, ds, np.inf).repeat(np.diff(mu.start))
    return float((np.abs(found.residual) / size).max(initial=0.0))


def _lifted(problem, cells, asked, lines, degree, extent) -> Array:
    """Norms of w; where conditions at a vertex disagree, of one on secondaries alone."""
    for alone in (False, True):
        on_lines = [one for line in lines for one in asked_on_contact(line.facing, alone)]
        try:
            return lifting_of(problem, cells, [*asked, *on_lines], degree, extent)
        except ContactError:
            if alone:
                raise
    raise AssertionError


def _share(problem: Problem, cells: Cells, pair: ContactState) -> float:
    """Of the lifting, that the secondary takes: by compliance."""
    sizes = []
    for segments in (pair.line.segments, pair.line.facing):
        at = cells.owner[np.isin(cells.segment, segments)][:1]
        if not at.size:
            return 1.0
        sizes.append(np.trace(compliance_at(problem, cells, places(cells, at, 0))[0, 0]))
    return float(sizes[0] / sum(sizes))


def _missed(problem, cells, displacement, elements, coefficients, lines, found, given, largest):
    """L2 norms (n, 3) of tractions that s misses on the boundary; work of s n on u_D - u_h."""
    trace = cells.trace
    side, have, ds = tractions_of(cells, elements, coefficients)
    position = np.full(len(cells.ends), -1)
    position[side] = np.arange(len(side))
    j, length = len(PLACES), ds / WEIGHTS
    x, _ = cells.points(np.repeat(side, j), np.tile(PLACES, len(side)))
    measure = trace.model.measure(x).reshape(ds.shape)
    asked = np.zeros_like(have)
    for pattern, at in given.loads:
        segment, s = cells.on_side(np.repeat(at, j), np.tile(PLACES, len(at)))
        asked[position[at]] += trace.evaluate(problem.traction_vector(pattern), segment, s).reshape(
            -1, j, 2
        )
    for line, p in zip(lines, found.pressure, strict=True):
        f = line.facing
        density = (p @ bernstein(p.shape[1] - 1, PLACES).T * f.weight / WEIGHTS)[
            ..., None
        ] * f.direction
        at = position[f.side]
        asked[at] -= density / (length[at] * measure[at])[..., None]
        if (f.other >= 0).all() and len(f.other):
            at = position[f.other]
            rate = np.abs(_rates(f))
            asked[at] += (
                _carried(f, density) * rate[..., None] / (length[at] * measure[at])[..., None]
            )
    held = given.held[side]
    norms = missed_tractions(cells, elements, coefficients, largest, asked, held)
    reaction = 0.0
    for pattern, values in problem.displacement.items():
        at = np.flatnonzero(np.isin(cells.segment, trace.segments(pattern)))
        segment, s = cells.on_side(np.repeat(at, j), np.tile(PLACES, len(at)))
        u = trace.evaluate(displacement, segment, s)
        p = position[at]
        ds = WEIGHTS * length[p] * measure[p]
        for c, value in enumerate(values):
            if value is not None:
                rest = (trace.evaluate(ng.CF(value), segment, s)[:, 0] - u[:, c]).reshape(-1, j)
                reaction += float((ds * have[p][..., c] * rest).sum())
    return norms, reaction


def _rates(facing: Facing) -> Array:
    """How fast t changes with t' (k, j) at the Gauss points of the primary's sides."""
    at = _inverse(facing.there)
    slopes = lagrange_derivative(DATA, at.ravel()).reshape(*at.shape, -1)
    return 1 / np.einsum("kji,il,kl->kj", slopes, THROUGH, facing.there)
