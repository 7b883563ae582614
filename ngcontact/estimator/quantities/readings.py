"""Quantities of interest of a solution.

The bar of the energy is proved, and beside its estimate that of the force, by a dual problem. The
others are estimated, by measurement (docs/bounds.md):

* force: of second order, 0.3 times the square of the relative estimate, 1.5 times at order 4;
  where Gamma_K ends on Gamma_u, more by what acts at the held point; where sides are curved, by
  what the shape of the mesh changes of the loads;
* peak pressure and von Mises stress: the largest lies between those of the discrete field less and
  plus an error, which is one number on each segment or element: of pressures twice the largest
  difference to p* there, or once that to the discrete stress; of von Mises 1.1 times the largest
  difference to that of the equilibrated stress, or half of the jump between elements;
* end of contact: how far from it the lines through the first two values of gap^(2/3) outside and
  of p^2 inside vanish, and 0.3 of the distance of the points between which it lies; contact
  area: the sum of those of its ends;
* approach: of second order, twice the square of the relative estimate, where it is not prescribed.

Where no bound is known, all are estimated, without the equilibrated stress and p*: the difference
to the discrete stress and the jump count twice as much. Peak and von Mises have no bar where the
relative estimate is more than 1.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, partial

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...contact import ContactState, signed_distance, state_of
from ...contact import area_in_contact as area_on_surface
from ...discrete import load_by_shape
from ...errors import ContactError, warn
from ...fem import BoundaryTrace, FacetTrace, load_vector, model_of, stress_of
from ...quadrature import loads_of
from ...solved import Solved
from ..bound import WORK_BONUS, EquilibratedStress, Guaranteed, force_bar
from ..residual import Estimated
from .contact import approach_of, area_in_contact, direction_of, ends_of, held_point_force, peak_of
from .stresses import largest_von_mises, singular_corners
from .surfaces import pressure_at_vertices, pressure_field
from .table import Quantities, Quantity, Singular

# Relative errors over the square of the relative estimate, measured on random scenes of all orders.
# By order: 96 % of 118 are at most that, most of Hertz.
FORCE_FACTORS = {1: 0.3, 2: 0.3, 3: 0.3, 4: 1.5}
APPROACH_FACTOR = 2.0  # 97 % of 187 are at most that
# Of what is prescribed, of forces relative to their terms.
VALUE_ROUND_OFF = 64 * np.finfo(float).eps
AXIS_COORDINATE = 1e-14  # coordinate over the bodies' extent that is 0
DX_ORDER = 5  # degree of NGSolve's quadrature with dx, without a bonus
STRAIGHT = 1e-12  # difference of directions that are one: round-off
EARLIER_LEVELS = 2  # before the last one, whose figures give the error
NAMES = (  # of figures of solids
    "force",
    *(f"force, {axis}" for axis in "xyz"),
    *("contact area", "mean pressure", "peak pressure", "energy"),
)


class Measured(Guaranteed):
    """Members of `Solution` that give figures with their errors."""

    @cached_property
    def _proved(self) -> tuple[EquilibratedStress | None, str]:
        """The stress that proves the bound, or why there is none."""
        try:
            return self.equilibrated, ""
        except (ContactError, ValueError) as error:
            return None, f"nothing is guaranteed: {error}"

    @cached_property
    def _force_errors(self) -> dict[int, tuple[float, str]]:
        """Proved errors of the force by pair, infinite where nothing is proved, and why."""
        return {}

    def contact_area(self, pair: int = 0) -> float:
        """Length of a pair's line in contact, an area about an axis and of solids.

        Of the secondary before deformation, up to `transitions`; any consistent units.
        """
        state, trace = state_of(self.pairs, pair), self.discrete.space.trace
        if isinstance(trace, FacetTrace):
            zone = signed_distance(self.problem, self.moduli, trace, state)
            return area_on_surface(zone, state)
        return area_in_contact(state, trace)[0]

    def pressure_field(self, pair: int = 0) -> ng.GridFunction:
        """The pressure of a pair as a function on its secondary, in units of stress.

        It is integrated over that boundary and read at points of it, as those of
        ``mesh.MapToAllElements(rule, mesh.Boundaries(secondary))``; elsewhere it is 0, also on the
        primary, which ``mesh(x, y, z, ng.BND)`` may find where both coincide.

        In the plane polynomials of degree `order` on each segment, which meet `pressure` at the
        contact points; on a segment that faces the primary in part they are times the share that
        faces it, so that the resultant is that of the contact. On solids of order 1 in H1 at orders
        1 and 2, between the pressures at vertices: at order 2 means, by area, of the linear
        functions through the middles of edges, whose resultant on plane facets is that of the
        contact. Where facets face the primary in part it is linear on each facet, nowhere negative,
        and has the resultant of the contact there. At order 3 of degree 2 on each facet with a
        point in contact, the mean traction of both sides but for a constant, so that the resultant
        is that of the contact, too: better than `pressure` where the stress is resolved
        (docs/solids.md).
        """
        self.discrete.space.require_mesh()
        return pressure_field(self, state_of(self.pairs, pair))

    def quantities(self, pair: int = 0) -> Quantities:
        """Force, contact area, pressures, ends, approach, energy, von Mises stress, with errors.

        Each in units of the data, any consistent units; printed as a table, found by name:
        "force", along a direction that the note tells, "force, x", "force, y", "contact area" (a
        length in planes), "mean pressure", "peak pressure", "end of contact, x" or "y",
        "approach", "energy", "von Mises". The bar of the energy is proved, and that of the force
        as a rule beside its estimate. Where no bound is known all are estimates, and a
        `ContactWarning` and a note below the table say why. Where corners make a stress infinite
        the row names them; its value is the largest farther away than a tenth of the way to the
        next corner of the drawing.

        Of solids forces, with "force, z", area, pressures, of which the peak is that of
        `pressure_field`, and energy. Levels of `adapt` from the third on have errors: the larger of
        the last two differences between levels. Without any pair energy and von Mises stress are
        left, of solids the energy.
        """
        state = state_of(self.pairs, pair) if self.pairs or pair != 0 else None
        if self.problem.dim == 3:
            return quantities_of_solids(self, state, pair)
        boundary, known = self.discrete.space.trace, "_proved" in vars(self)
        proof, reason = self._proved
        if proof is None and not known:
            warn(f"{reason}; all errors of quantities() are estimates")
        corners = singular_corners(self.problem, boundary, self.pairs)
        rows, note = list[Quantity](), ""
        if state is not None:
            rows, note, reason = _of_pair(self, state, pair, corners)
        equilibrated = None if proof is None else partial(_on_lattice, proof)
        rows += [_energy(self, proof is not None), largest_von_mises(self, equilibrated, corners)]
        size, notes = float(np.abs(boundary.curve).max()), [note, reason]
        if proof is not None and proof.proof.dual.cells.curved.any():
            degree = boundary.geometry_order
            notes.append(f"guaranteed on the domain of the mesh, of curves of degree {degree}")
        for k, row in enumerate(rows):
            if row.place is not None:
                off_axis = np.abs(row.place) >= AXIS_COORDINATE * size
                rows[k] = replace(row, place=np.where(off_axis, row.place, 0.0))
        return Quantities(tuple(rows), "; ".join(text for text in notes if text))


def _on_lattice(
    equilibrated: EquilibratedStress, element: Index, places: Array, known: Mask
) -> Array:
    """That stress (k * n, c) at the same n `places` (n, 2) of each `element` (k,).

    It is 0 where it is not `known` (k, n). On elements with straight sides that are no parts its
    polynomials have the same values at the places in each.
    """
    cells, n = equilibrated.proof.dual.cells, len(places)
    own, count = np.zeros(cells.trace.mesh.ne, dtype=np.intp), np.bincount(cells.parent)
    own[cells.parent] = np.arange(len(cells.parent))
    alike = (count == 1) & ~cells.trace.curved_elements & (cells.trace.model.extent == 0)
    found = np.zeros((*known.shape, equilibrated.proof.dual.elements[0].strain.shape[2]))
    shares = np.column_stack([places, 1 - places.sum(axis=1)])
    first = cells.barycentric[own, 0].argmax(axis=1)  # vertex of the element at corner 0
    for k in range(3):
        some = np.flatnonzero((alike & (first == k))[element])
        local = np.roll(shares, -k, axis=1)[:, [2, 0]]
        found[some] = equilibrated.proof.stress.s.values(own[element[some]], local)
    known = known & ~alike[element, None]
    at, place = known.nonzero()
    found[known] = equilibrated.values(element[at], places[place])
    return found.reshape(len(element) * n, -1)


def _of_pair(
    solution: Measured, state: ContactState, pair: int, corners: Singular
) -> tuple[list[Quantity], str, str]:
    """Rows of a pair's force, pressures, ends and approach, a note, and why none is proved."""
    boundary, (proof, reason) = solution.discrete.space.trace, solution._proved
    star = None
    if proof is not None:
        star = proof.pressure[pair].values(*boundary.at_nodes(state.line.segments))
    e, along = direction_of(solution, pair)
    e = e + 0.0  # no -0
    largest = max(abs(float(one.force.sum())) for one in solution.pairs)
    factor = FORCE_FACTORS[min(solution.order, max(FORCE_FACTORS))]
    of_order = factor * solution.relative_error_estimate**2 * largest
    sum_error = of_order + held_point_force(state, boundary)
    of_shape = float(np.linalg.norm(load_by_shape(solution.problem, solution.mesh)))
    force = solution.contact_force(pair)
    parts = {"force": e @ force, "force, x": force[0] + 0.0, "force, y": force[1] + 0.0}
    # Along directions that its points do not have, and radially about an axis, a force is 0.
    d = state.line.direction
    sizes = model_of(solution.problem).resultant(np.abs(d).max(axis=0, initial=0.0))
    errors = sum_error * np.append(np.abs(d @ e).max(initial=0.0), sizes)
    each = zip(parts.items(), errors.tolist(), strict=True)
    forces = [Quantity(name, float(value), bar, "estimated") for (name, value), bar in each]
    if proof is not None:
        forces, reason = _with_proof(solution, forces, pair, e)
    if of_shape > VALUE_ROUND_OFF * largest:
        forces = [replace(x, error=x.error + of_shape, kind="estimated") for x in forces]
    rows = [
        *forces,
        *_means(state, boundary, sum_error + of_shape),
        peak_of(solution, state, star, corners),
        *ends_of(state),
        _approach(solution, state, e, forces[0].error if along == "itself" else 0.0),
    ]
    words = ", ".join(f"{x:.4g}" for x in e.round(12) + 0.0)
    return rows, "" if along == "itself" else f"force along {along}, ({words})", reason


def _means(state: ContactState, boundary: BoundaryTrace, error: float) -> list[Quantity]:
    """Contact area and mean pressure, of a sum of forces with an `error`."""
    area, bar = area_in_contact(state, boundary)
    name, other = "contact area", "mean pressure"
    if not area > 0:
        return [Quantity(name, 0.0), Quantity(other, 0.0)]
    mean = float(state.force.sum()) / area
    return [
        Quantity(name, area, bar, "estimated"),
        Quantity(other, mean, error / area + abs(mean) * bar / area, "estimated"),
    ]


def _approach(solution: Measured, state: ContactState, e: Array, turning: float) -> Quantity:
    """The approach along `e` (2,); what is prescribed has an error of round-off alone.

    And that of e, where that is the direction of the force itself, with an error `turning`.
    """
    moved, free = approach_of(solution, state)
    value, relative = abs(float(moved @ e)), solution.relative_error_estimate
    size = float(np.linalg.norm(state.line.direction.T @ state.force))
    turn = turning / size if size > 0 else 0.0
    error = APPROACH_FACTOR * relative**2 * float(free @ np.abs(e)) + VALUE_ROUND_OFF * value
    error += turn * float(np.linalg.norm(moved))
    return Quantity("approach", value, error, "estimated")


def _energy(solution: Measured, proved: bool) -> Quantity:
    """L(u_h); it exceeds L(u) by half the square of the error, but for gaps and supports."""
    value = solution.energy
    if not proved:
        return Quantity("energy", value, solution.error_estimate**2, "estimated")
    low, high = solution.energy_bounds
    return Quantity("energy", value, float(max(high - value, value - low)), "guaranteed")


def _with_proof(
    solution: Measured, forces: list[Quantity], pair: int, e: Array
) -> tuple[list[Quantity], str]:
    """A pair's force along `e` (2,) and its components with proved errors, or why none is proved.

    Where directions of contact turn only what lies along e has one.
    """
    d, known = solution.pairs[pair].line.direction, solution._force_errors
    straight = len(d) > 0 and np.ptp(d, axis=0).max() <= STRAIGHT
    along = d[0] if straight else e  # the force is one number times d
    if pair not in known:
        try:
            known[pair] = _force_error(solution, pair, along), ""
        except (ContactError, ValueError) as none:
            known[pair] = np.inf, f"no error of the force is proved: {none}"
    error, reason = known[pair]
    for k, share in enumerate(np.abs(np.vstack([e, np.eye(2)]) @ along).tolist()):
        if error < np.inf and (straight or share >= 1 - STRAIGHT):
            forces[k] = forces[k].with_proof(error * share if share > STRAIGHT else 0.0)
    return forces, reason


def _force_error(solution: Guaranteed, pair: int, e: Array) -> float:
    """Bound of the error of the component of a pair's contact force along `e` (2,)."""
    if not solution.problem.model.startswith("plane"):
        raise ValueError(f'no bar of the force is proved for "{solution.problem.model}"')
    if len(solution.pairs[pair].line.node) == 0:
        raise ValueError("the points of this pair belong to other pairs, which have its force")
    loads = loads_of(solution.problem, solution.mesh)
    if any(load.where_rough(solution.order) for load in loads):
        raise ValueError("loads that are rougher than the mesh count as they are integrated")
    states, space, u = solution.pairs, solution.discrete.space, solution.displacement
    directions = [e if number == pair else 0 * e for number in range(len(states))]
    jumps = [s.line.direction @ d for s, d in zip(states, directions, strict=True)]
    jump = np.where(solution.active, np.concatenate(jumps), 0.0)
    found = solution.discrete.influence(solution.active, jump)
    G = solution.discrete.displacement(found.u, None)
    solution.work["factorizations"] += found.factorizations
    solution.work["back_solves"] += found.back_solves
    solution.work["equilibrations"] += 1
    error = force_bar(solution.equilibrated.proof, u, G, directions)
    a, b = (x.vec.FV().NumPy() for x in (u, G))
    noise = VALUE_ROUND_OFF * float(np.sqrt((space.diagonal @ a**2) * (space.diagonal @ b**2)))
    # What quadrature of stiffness and loads misses of A(u_h, G) - l(G).
    problem, missed = solution.problem, 0.0
    if problem.force or problem.traction:
        missed -= float((load_vector(problem, space.V, WORK_BONUS) - space.f) @ b)
    inexact = space.trace.curved_elements | bool(problem.varying)
    if inexact.any():
        p, geometry = space.trace.order, space.trace.geometry_order
        work = ng.InnerProduct(stress_of(problem, u), ng.Sym(ng.Grad(G)))
        fine, mesh = 2 * p * geometry + 2 * geometry + 8, space.trace.mesh
        for some, order in ((inexact, fine), (~inexact, 2 * p)):
            dx = ng.dx(bonus_intorder=order - DX_ORDER, definedonelements=ng.BitArray(some))
            missed += float(ng.Integrate(work * dx, mesh))
        missed -= float(a @ (space.A @ b)) - (0.0 if space.initial is None else space.initial @ b)
    error += noise + abs(missed)
    size = float(np.linalg.norm(solution.contact_force(pair)))
    if error > size > 0:
        raise ValueError(f"what is proved, {error:.2g}, is more than the force itself")
    return error


def figures(solution: Solved, state: ContactState) -> tuple[Array, Array]:
    """Values (8,) of a pair of solids by `NAMES`, and where (3,) the pressure is largest."""
    trace, line = solution.discrete.space.trace, state.line
    assert isinstance(trace, FacetTrace)  # of solids
    force = -state.force @ line.direction
    along = float(np.linalg.norm(force))
    if line.contact.direction is not None:
        along = abs(float(force @ np.array(line.contact.direction)))
    zone = signed_distance(solution.problem, solution.moduli, trace, state)
    area = area_on_surface(zone, state)
    if trace.order == 3:
        facet, s = trace.at_nodes(line.segments)
        pressure = trace.evaluate(pressure_field(solution, state), facet, s)[:, 0]
    else:
        facet, s = trace.at_places(line.segments, trace.vertices)
        pressure = pressure_at_vertices(trace, state).ravel()
    at = np.argmax(pressure)
    mean, peak = float(state.force.sum()) / area if area > 0 else 0.0, float(pressure[at])
    values = [along, *(force + 0.0), area, mean, peak, solution.energy]
    return np.array(values), trace.point(facet[[at]], s[[at]])[0]


def earlier_figures(solution: Estimated) -> tuple[Array, ...]:
    """Figures (c, 8) of this level and the one before, of solids, for the errors of the next."""
    if solution.problem.dim == 2:
        return ()
    now = np.array([figures(solution, state)[0] for state in solution.pairs])
    return (*solution.earlier, now)[-EARLIER_LEVELS:]


def quantities_of_solids(solution: Estimated, state: ContactState | None, pair: int) -> Quantities:
    """Values of a pair, on levels of `adapt` with errors; without any pair the energy."""
    if state is None:
        alone = Quantity("energy", solution.energy)
        return Quantities((alone,), "without an error, as without pairs")
    values, place = figures(solution, state)
    levels = np.array([*(before[pair] for before in solution.earlier), values])
    known = len(levels) > EARLIER_LEVELS
    errors = np.abs(np.diff(levels, axis=0)).max(axis=0) if known else np.full(len(NAMES), np.nan)
    places = {"peak pressure": place}
    rows = [
        Quantity(name, float(x), float(bar), "estimated" if known else "none", places.get(name))
        for name, x, bar in zip(NAMES, values, errors, strict=True)
    ]
    note = "errors: the larger of the last two differences between levels"
    if not known:
        note = "without errors: the third level of adapt and later ones have them"
    return Quantities(tuple(rows), note)
