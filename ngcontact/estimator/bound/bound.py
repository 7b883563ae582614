"""A bound of the error that is proved: the identity of Prager and Synge with contact.

With a stress s in equilibrium with the loads, p* >= 0 on Gamma_K, and w that corrects what u_h
misses on Gamma_u and Gamma_K, without a constant

    |u - u_h|^2 <= B^2 = |s - sigma_h|^2 + 2 int p* (gap_h + r) + |w|^2,

where gap_h + r >= 0 is the gap of u_h + w; docs/bounds.md has the proof. s and p* minimise B^2:
they solve the dual contact problem. Where F or P are no polynomials s balances projections of them.
Cells on which that counts are divided, and the bound is made again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...contact import ContactState
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...problem import Problem, numbers
from ...quadrature import SampledElements, features_of, loads_of, unresolved, where_features_are
from .cells import Cells, alike, bisected, cells_of, dependent, parted, places
from .elements import Element, by_triangle, elements_of, projection, traces
from .facing import (
    POINTS,
    WEIGHTS,
    PressureSupport,
    facing_middles,
    facing_sides,
    guides,
    held_motions,
    new_vertices,
    pressure_support,
)
from .lifting import lifted, prescribed_on_supports
from .oscillation import oscillation_norms
from .program import AdmissibleStress, DualProblem, dual_problem
from .tractions import FINEST_PARTS, LEAST_PART, boundary_data, rough_places

NO_BOUND = "no guaranteed bound is known"
BESIDE_VERTICES = (0.1, 0.9)  # places beside vertices, where pressures have resultants near to them
LIFTING_DEGREES = 3  # degrees by which w is above u_h
NEGLIGIBLE_LOADS = 0.1  # of |s - sigma_h|^2: cells are not divided for less
CURVED_RATIO = 0.125  # of D_T on half of a triangle with a curved side, at least expected
NEGLIGIBLE_SHARE = 0.03  # of |s - sigma_h|: so much data may miss on cells that stay as they are
# Angle by which a side may turn: at order 4 one of 53 degrees missed 40 % of B^2, of 26 none.
LARGEST_TURN = math.radians(40.0)
FORCED_DEGREE = 3  # least degree of stresses with forces that are no numbers
# Part of modulus times displacement over size of an element: equilibrium is measured beside the
# round-off of such stresses.
NOTICEABLE_STRAIN = 1e-4


@dataclass(frozen=True, eq=False)
class Proof:
    """Everything that a bound was computed from."""

    problem: Problem
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
    except ContactError:
        # Resultants that no polynomial pressure has, as of a body about to tilt, or rough forces of
        # which quadrature misses too much for a body that moves freely.
        return _bound(problem, trace, displacement, pairs, BESIDE_VERTICES)


def _bound(
    problem: Problem,
    trace: BoundaryTrace,
    displacement: ng.GridFunction,
    pairs: Sequence[ContactState],
    beside: Sequence[float],
) -> Proof:
    """The bound in the steps of docs/bounds.md.

    With `beside`, p* also has breaks there beside ends of segments, and cells are bisected where
    forces are rough.
    """
    touching = [name for pair in problem.contact for name in pair.sides]
    loaded = trace.segments(*problem.traction, *touching, problem.guide)
    loaded = loaded[~trace.on_axis[loaded]]
    fixed = [name for name, values in problem.displacement.items() if None not in values]
    degree = trace.order + LIFTING_DEGREES
    reaches = [pressure_support(trace, displacement, pair, degree) for pair in pairs]
    both = zip(rough_places(problem, trace), new_vertices(trace, reaches, beside), strict=True)
    reaches += [pressure_support(trace, displacement, x, degree) for x in guides(problem, trace)]
    segment, s = (np.concatenate(parts) for parts in both)
    supported = trace.segments(*fixed)
    cells, largest_size = cells_of(trace, (segment, s)), force_features(problem, trace)
    for load in loads_of(problem, trace.mesh) if beside else ():
        if load.kind == "force" and (forces := load.where_rough(trace.order)) is not None:
            size = np.where(forces.rough, SampledElements(trace.mesh, 2).sizes / 4, np.inf)
            largest_size = np.minimum(size, largest_size)

    def linked(cells: Cells) -> tuple[Index, Index, Array]:
        return facing_middles(cells, displacement, reaches)

    def large(cells: Cells) -> Mask:
        return (cells.diameters > largest_size[cells.parent]) | (cells.turn > LARGEST_TURN)

    while (marked := large(cells)).any():
        cells, _ = bisected(cells, marked, linked)
    parts, whole = parted(cells, dependent(cells, loaded, supported))
    found = _proof(problem, parts, displacement, reaches)
    if found.parts["loads"] <= NEGLIGIBLE_LOADS * found.parts["constitutive"]:
        return found
    c, D = (np.sqrt(np.bincount(whole, x**2)) for x in (found.stress.distance, found.stress.loads))
    cells = divided(problem, cells, found.dual.elements, (c, D), linked)
    parts, _ = parted(cells, dependent(cells, loaded, supported))
    other = _proof(problem, parts, displacement, reaches)
    return min(found, other, key=lambda proof: proof.bound)


def divided(
    problem: Problem,
    cells: Cells,
    elements: Sequence[Element],
    norms: tuple[Array, Array],
    linked: Callable[[Cells], tuple[Index, Index, Array]],
) -> Cells:
    """Cells so small that data add little to a bound; the same where they are.

    `norms` (n,) are |s - sigma_h| and D_T on the `cells`, from `elements` on parts of these. On
    smaller cells D_T is that of the loads, and on curved ones a part of the former; `linked` is as
    of `bisected`.
    """
    distance, D = norms
    limit, ne = (NEGLIGIBLE_SHARE * float(np.linalg.norm(distance))) ** 2, cells.trace.mesh.ne
    finest = cells.elements.sizes / FINEST_PARTS
    moduli, degree = np.full(ne, np.inf), np.zeros(ne, dtype=np.intp)
    for e in elements:
        parent = e.places.cells.parent[e.places.at]
        np.minimum.at(moduli, parent, e.modulus)
        np.maximum.at(degree, parent, e.basis.degree)
    force = cells.trace.mesh.MaterialCF(problem.force, default=ng.CF((0, 0)))
    while True:
        order = np.argsort(D)
        marked = np.zeros(len(D), dtype=bool)
        marked[order[np.cumsum(D[order] ** 2) > limit]] = True
        marked &= cells.diameters > finest[cells.parent]
        if not marked.any():
            return cells
        cells, whole = bisected(cells, marked, linked)
        missed, new = np.zeros(len(whole)), np.flatnonzero(np.bincount(whole)[whole] > 1)
        rough = new[: 0 if all(map(numbers, problem.force.values())) else None]
        for (n, _), at in alike([degree[cells.parent], cells.curved], rough):
            own = n - 1 - cells.trace.model.extent
            missed[at] = projection(force, places(cells, at, 2 * n + 4), own)[1]
        given, P = boundary_data(problem, cells), traces(int(degree.min()), POINTS)
        near = P @ ((P.T * WEIGHTS) @ given.loads)
        sides = given.missed(near, (), (), float(np.abs(near).max(initial=0.0)))
        found = oscillation_norms(cells, missed, moduli[cells.parent], sides)
        D = D[whole]
        D[new] = np.maximum(found[new], CURVED_RATIO * cells.curved[new] * D[new])


def force_features(problem: Problem, trace: BoundaryTrace) -> Array:
    """Largest sizes (ne,) of cells, by element, that show narrow features of forces; lengths."""
    view, found = SampledElements(trace.mesh, 2), np.full(trace.mesh.ne, np.inf)
    for one in features_of(problem, trace.mesh):
        if one.kind == "force" and len(one.spots):
            at, feature = where_features_are(one.spots, view, np.arange(trace.mesh.ne))
            narrow = at[view.sizes[at] > one.spots[feature, 2] / LEAST_PART]
            found[narrow] = view.sizes[narrow] / FINEST_PARTS
    return found


def _proof(
    problem: Problem,
    cells: Cells,
    displacement: ng.GridFunction,
    reaches: Sequence[PressureSupport],
) -> Proof:
    """The bound on given cells."""
    trace = cells.trace
    p, extent = trace.order, trace.model.extent
    degree, lift = max(p + 1, 2 + extent), p + LIFTING_DEGREES
    if not all(map(numbers, problem.force.values())):
        degree = max(degree, FORCED_DEGREE)
    # 2. Stresses.
    given = boundary_data(problem, cells)
    mu, elements = elements_of(problem, cells, displacement, degree)
    # 3. The gap, on guides and on Gamma_K.
    prescribed = prescribed_on_supports(problem, cells, displacement)
    holding = [(x.side, x.direction[:, [0, -1]]) for x in prescribed]
    held = held_motions(cells, holding, reaches)
    moduli, degrees = by_triangle(elements, [e.modulus for e in elements]), (degree - extent, lift)
    lines = [facing_sides(cells, displacement, x, degrees, held, moduli) for x in reaches]
    every = np.arange(len(trace.region))
    sizes = [trace.evaluate(displacement, every, np.zeros(len(every)))]
    size = max(float(np.abs(x).max(initial=0.0)) for x in sizes + [x.gap for x in lines])
    # 4. w, before a factor takes memory.
    w = lifted(problem, cells, prescribed, [(line, line.lift) for line in lines], lift, size)
    # The dual problem: s and p*.
    dual = dual_problem(cells, given, prescribed, mu, elements, lines)
    stiffest = min(np.diagonal(e.compliance, axis1=-2, axis2=-1).min() for e in elements)
    felt = NOTICEABLE_STRAIN * size / float(stiffest * cells.diameters.min())
    stress = dual.nearest(felt)
    # The identity.
    c, D = stress.distance, stress.loads
    if (lost := ~np.isfinite(D)).any():
        where = "where curves turn far"
        if trace.model.on_axis(cells.corners[lost].reshape(-1, 2)).any():
            where = "at the axis"
        raise ValueError(
            f"{NO_BOUND} for loads that are no polynomials {where}; use error_estimate"
        )
    closed = float(sum((p * x.bound).sum() for p, x in zip(stress.pressure, lines, strict=True)))
    parts = {
        "constitutive": float(c @ c),
        "complementarity": 2 * closed,
        "lifting": float(w @ w),
        "loads": float(D @ (2 * c + D)),
    }
    # What holds free motions does work on u_h, of which L(u_h) does not tell.
    idle = stress.free_force and stress.free_force * largest(elements, displacement)
    below = float(c @ c / 2 + D @ (c + D / 2 + 2 * w)) - stress.work + idle
    above = float((c + D + w / 2) @ w) + stress.work + closed + idle
    return Proof(problem, dual, stress, lifting=w, parts=parts, below=below, above=above)


def largest(elements: Sequence[Element], function: ng.CoefficientFunction) -> float:
    """The largest component of a function at points of quadrature."""
    return max(float(np.abs(e.places.evaluate(function)).max()) for e in elements)


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
    for pattern in (*problem.displacement, *problem.traction, problem.guide):
        if trace.inner[trace.segments(pattern)].any():
            raise ValueError(
                f'{NO_BOUND} for conditions on a line inside a body, as on "{pattern}"'
            )
    for line, force in ((pair.line, pair.force) for pair in pairs):
        loaded = (line.on_segments(force, 0.0) != 0).any(axis=1)
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
