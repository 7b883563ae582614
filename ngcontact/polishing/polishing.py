"""Polish a solution: its ends of contact become vertices of a coarse mesh of high order.

Contact takes all smoothness away from a solution but at the ends of its zone, and at corners. On a
mesh that is graded geometrically towards them (hp version), with vertices that follow the ends,
errors fall exponentially with the order. In each step the zone is known: contact holds with
equality where it is closed, and nowhere else.

Where a zone ends too far out or in by t, the gap beside the end is K r^(1/2) + c r^(3/2) + ... with
the distance r from it, and K = 3/2 c t to first order: the end of the contact problem, with K = 0,
is found by Newton's method for each end alone, since the solution depends on t by t^2 only.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..adaptivity import END_POWER, corners
from ..arrays import Array, Mask
from ..contact import by_line
from ..discrete import discretise, minimise_energy
from ..errors import ContactError, ConvergenceError, warn
from ..fem import (
    BoundaryTrace,
    boundary_corners,
    boundary_trace,
    model_of,
    prescribed_components,
)
from ..lagrange import gauss, lagrange
from ..mesh import cad_edges, check_curves, resolved_lengths
from ..problem import MeshArrays, Problem
from ..solution import Solution, solution_of
from ..solved import Solved
from .geometric_mesh import (
    CORNER_RATIO,
    END_RATIO,
    EndOfContact,
    GeometricMesh,
    coarse_mesh,
    isolated,
)

MAX_DIGITS = 12
ORDERS = (4, 6, 8, 10)
MAX_STEPS = 12  # of Newton's method, at one order
STEP_TOLERANCE = 1e-2  # of the size of elements at the ends: how closely these are found at order 4
MAX_STEP = 0.3  # of the segments beside, by which an end may move in a step
MIN_LAYERS = 2
PLACE_DISTANCE = 1e-9  # of the extent, up to which two places are one
RIGHT_ANGLE_ERROR = 1e-3  # radians by which a right angle may differ from one
BLUNT_ANGLE = 0.5  # radians by which a convex corner turns at least
LEAST_RATIO = 0.2  # of two changes from order to order, for errors; measured: 0.01 to 0.1
RATIO_GROWTH = 2.0  # ... from one order to the next at most; measured: 1.5 to 2.3
MAX_RATIO = 0.8  # ... of what hardly converges
ELEMENT = "isoparametric"
FIT_DEGREE = 4  # of gap / r^(1/2) in r, over the layers
SAMPLES_PER_NODE = 3  # per node, at which signs are looked at
PRESSURE_ERROR = 1e-3  # of the largest, which is the error of pressures at ends
GAP_ERROR = 1e-6  # of the largest displacement
ROUND_OFF = 1e-6  # of distances on curves, in which ends of segments are compared

log = logging.getLogger("ngcontact")


def polish(solution: Solution, digits: int = 8) -> Solution:
    """A plane solution made more accurate: as many digits of energy and forces as asked for.

    Parameters
    ----------
    solution : Solution
        Of a geometry, with matched nodes or rigid obstacles, and contact that ends somewhere.
    digits : int
        Correct digits of the energy and of forces that are aimed at, 1 to 12.

    Returns
    -------
    Solution
        Of order 6, 8 or 10 on a coarse mesh with vertices at the ends of contact, which are its
        `transitions`. As many parts are in contact as of the given solution. Where that comes out
        with tension or penetration, or nothing converges, the given one, with a warning.

    Raises
    ------
    ValueError, TypeError
        Bodies, pairs or zones that it does not serve, before any work.
    """
    _check(solution, digits)
    try:
        return _polished(solution, digits)
    except (RuntimeError, ValueError) as error:  # of meshing, solving, or of what follows
        warn(f"polish returns the solution as it is: {error}")
        return solution


def _check(solution: object, digits: object) -> None:
    """Raise on what is not served."""
    if not isinstance(solution, Solution):
        raise TypeError(f"polish takes a Solution, not a {type(solution).__name__}")
    if isinstance(digits, bool) or not isinstance(digits, int | np.integer):
        raise TypeError(f"digits={digits!r} is not an integer; give 1 to {MAX_DIGITS}")
    if not 1 <= digits <= MAX_DIGITS:
        raise ValueError(f"digits={digits}: give 1 to {MAX_DIGITS}")
    problem = solution.problem
    problem.refuse_solids("polish")
    if problem.model == "axisymmetric":
        raise ValueError("polish is for plane bodies: refine bodies of revolution by adapt")
    if cad_edges(solution.mesh) is None:
        raise ValueError("polish makes a mesh of its own: give the problem a geometry, not a mesh")
    for number, state in enumerate(solution.pairs):
        contact = state.line.contact
        name = f'the pair {number} ("{contact.secondary}")'
        if contact.bilateral:
            raise ValueError(f"{name} is bilateral, and contact does not end: refine by adapt")
        if (state.line.means & state.active).any():
            raise ValueError(
                f"{name} has nodes in contact that face no nodes: solve without a given mesh, on "
                'one that is made from the geometry, with rows="auto"'
            )
    ends = [isolated(state) for state in solution.pairs]
    if not sum(len(one) for one in ends):
        raise ValueError("contact has no ends that could be followed: refine by adapt")
    if not any(one.any() for one in ends):
        raise ValueError("contact ends at corners only, which do not move: refine by adapt")


def _polished(solution: Solution, digits: int) -> Solution:
    """The solution of the order that has so many digits, with its ends of contact in place."""
    problem, extent = solution.problem, MeshArrays(solution.mesh).extent
    mesh = coarse_mesh(problem, solution.pairs, extent)
    count = sum(int(isolated(state).sum()) for state in solution.pairs)
    if len(mesh.ends) != count:
        raise ContactError(
            f"a mesh with vertices at its {count} ends of contact was not found; refine first"
        )
    layers = _layers(problem, mesh, digits)
    values, error = list[Array](), math.inf
    for order in ORDERS:
        final, fewer = False, (ORDERS[-1] - order) // 2
        for step in range(MAX_STEPS):
            graded = mesh
            for vertex, (ratio, number) in layers.items():
                graded = graded.with_layers(vertex, ratio, max(number - fewer, MIN_LAYERS))
            polished = solve_bilateral(problem, graded, order)
            if step == 0 and order > ORDERS[0]:
                # The mesh is made for so many digits: small changes may be chance.
                error = _error([*values, _quantities(polished)])
                final = error <= 10.0**-digits or order == ORDERS[-1]
                error = max(error, 10.0**-digits)
            share, mesh = _followed(mesh, polished)
            log.info(
                "polish: order %d, %d unknowns, ends off by %.1e of elements, estimated error %.1e",
                order,
                polished.displacement.space.ndof,
                share,
                error,
            )
            if share <= (10.0 ** (1 - digits) if final else STEP_TOLERANCE):
                break
        else:
            raise ContactError(f"its ends of contact do not settle at order {order}")
        values.append(_quantities(polished))
        if final:
            break
    if not error < math.sqrt(10.0**-digits):
        raise ContactError(f"orders {ORDERS} do not converge: they leave errors of {error:.1e}")
    tips = [tip for vertex in layers for tip in (vertex, int(mesh.partner[vertex]))]
    if (wrong := wrong_signs(polished, tips)) is not None:
        raise ContactError(wrong)
    if (reached := round(-math.log10(error))) < digits:
        warn(f"polish: order {order} has about {reached} digits, not {digits}")
    return polished


def _quantities(solution: Solved) -> Array:
    """Figures (q,) that are to converge: the forces of all pairs and the energy."""
    forces = [solution.contact_force(k) for k in range(len(solution.pairs))]
    return np.append(np.concatenate(forces), solution.energy)


def _error(values: list[Array]) -> float:
    """Relative error of the last of the values of orders, if changes go on to fall as they did."""
    size = np.abs(values[-1])
    size[:-1] = size[:-1].max()
    changes = (np.abs(np.diff(values, axis=0)) / size).max(axis=1)
    fall = 0.0 if len(changes) == 1 else RATIO_GROWTH * float(changes[-1] / changes[-2])
    ratio = min(max(fall, LEAST_RATIO), MAX_RATIO)
    return float(changes[-1]) * ratio / (1 - ratio)


def _followed(mesh: GeometricMesh, solution: Solved) -> tuple[float, GeometricMesh]:
    """Share of the segments beside by which ends of contact are off; the mesh with them moved."""
    largest, moved = 0.0, mesh
    for end in mesh.ends:
        beside = mesh.vertices[[end.closed, end.opened]] - mesh.vertices[end.vertex]
        size = float(np.linalg.norm(beside, axis=1).min())
        share = -excess(solution, mesh, end) / size
        if not math.isfinite(share):
            raise ContactError("the gap beside an end of contact does not open")
        largest = max(largest, abs(share))
        moved = moved.moved(end, size * float(np.clip(share, -MAX_STEP, MAX_STEP)))
    return largest, moved


def _layers(problem: Problem, mesh: GeometricMesh, digits: int) -> dict[int, tuple[float, int]]:
    """Ratio and number of the layers at ends of contact and at other singular vertices."""
    trace = boundary_trace(mesh.source, 1, model_of(problem))
    found, regular = corners(problem, trace), _regular_corners(problem, trace, mesh)
    # The squared error falls with h^(2 power), and a tenth of the energy or less is there.
    corner, end = (-(digits - 1) / 2 / math.log10(ratio) for ratio in (CORNER_RATIO, END_RATIO))
    count = max(MIN_LAYERS, round(end / END_POWER))
    layers = {end.vertex: (END_RATIO, count) for end in mesh.ends}
    room = resolved_lengths(mesh.source)  # over the least that curves may have
    faced = {int(k): vertex for vertex, k in enumerate(mesh.partner) if k >= 0}
    for place, power in zip(found.places, found.powers, strict=True):
        distance = np.linalg.norm(mesh.vertices - place, axis=1)
        at = (distance <= PLACE_DISTANCE * distance.max()) & ~regular
        for vertex in np.flatnonzero(at).tolist():
            one = faced.get(vertex, vertex)
            beside = np.isin(mesh.segments, (one, mesh.partner[one])).any(axis=1)
            most = -math.log(room[beside].min()) / math.log(CORNER_RATIO)
            layers[one] = CORNER_RATIO, math.ceil(min(corner / power, max(most - 1, 0)))
    return layers


def _regular_corners(problem: Problem, trace: BoundaryTrace, mesh: GeometricMesh) -> Mask:
    """Vertices (nv,) at which conditions change without a singularity worth of layers.

    Right angles at a guide, a line of symmetry: their mirror image has no corner. Convex corners
    between sides that tractions or nothing act on. And where a side is free on both sides.
    """
    every = np.arange(len(trace.region))
    normal = trace.exact_normal(every, np.full(len(every), 0.5))
    given = prescribed_components(problem, trace)
    across = np.abs(normal.T) > 1 - RIGHT_ANGLE_ERROR**2
    guide = trace.lies_on(every, problem.guide)
    held = guide | given.any(axis=0)
    guide |= (given & across).any(axis=0) & ~given.all(axis=0)
    touching = np.unique(mesh.segments[mesh.closed])
    touching = np.union1d(touching, mesh.partner[touching])
    natural = ~held & ~np.isin(mesh.segments, touching).all(axis=1)
    free = natural & ~trace.lies_on(every, *problem.traction)
    straight = np.array([edge.straight for edge in mesh.edges])[trace.region]
    found = boundary_corners(trace)
    convex = found.angle < np.pi - BLUNT_ANGLE
    right = np.abs(np.cos(found.angle)) < RIGHT_ANGLE_ERROR
    mirrored = (guide & straight)[found.sides].any(axis=1) & right
    smooth = np.where(convex, *(x[found.sides].all(axis=1) for x in (natural, free)))
    regular = np.zeros(len(mesh.vertices), dtype=bool)
    regular[found.vertex] = (found.angle < np.pi + BLUNT_ANGLE) & ((convex & mirrored) | smooth)
    return regular


def solve_bilateral(problem: Problem, mesh: GeometricMesh, order: int) -> Solution:
    """The solution with contact on the closed segments of a mesh, of degree `order`."""
    curved = mesh.mesh(order)
    check_curves(curved)
    discrete = discretise(problem, curved, order, ELEMENT)
    p, lines = discrete.program, discrete.lines
    zone = np.zeros(len(p.g), dtype=bool)
    for line, closed in zip(lines, by_line(lines, zone), strict=True):
        points = line.rows[mesh.closed[line.segments]]
        closed[points[points >= 0]] = True
    known = replace(p, equality=zone, g=np.where(zone, p.g, np.inf))
    minimiser = minimise_energy(replace(discrete, program=known), zone)
    if not np.array_equal(minimiser.active, zone):
        raise ConvergenceError("contact alone cannot hold a body", iterate=minimiser)
    bent = int(np.count_nonzero(discrete.space.trace.curved_segments))
    return solution_of(minimiser, [discrete], ELEMENT, bent)


def excess(solution: Solved, mesh: GeometricMesh, end: EndOfContact) -> float:
    """Length by which a zone ends too far out, by the singular coefficient of the gap there."""
    state, x = solution.pairs[end.pair], mesh.vertices[end.vertex]
    reach = mesh.vertices[end.opened] - x
    size = float(np.linalg.norm(reach))
    r = np.linalg.norm(state.line.position - x, axis=1) / size
    beside = ~state.active & ((state.line.position - x) @ reach > 0)
    last = np.sort(r[beside])[solution.order - 1]  # the last layer does not know r^(1/2)
    beside &= (r > last * (1 + ROUND_OFF)) & (r < 1 + ROUND_OFF)
    r = r[beside]
    # The error of the gap in each layer is a share of r^(3/2), so that a weight of 1 / r is fair.
    powers = np.vander(r, FIT_DEGREE + 1, increasing=True) / r[:, None]
    K, c = np.linalg.lstsq(powers, state.gap[beside] / r**1.5, rcond=None)[0][:2]
    return float(K / (1.5 * c)) * size


def wrong_signs(solution: Solved, tips: Sequence[int]) -> str | None:
    """Tension or penetration between nodes, away from `tips` of layers; None without any."""
    trace, order = solution.discrete.space.trace, solution.order
    s, _ = gauss(2 * SAMPLES_PER_NODE * order)
    reach = np.abs(solution.displacement.vec.FV().NumPy()).max()
    for number, state in enumerate(solution.pairs):
        line = state.line
        closed = line.on_segments(state.active, False).all(axis=1)
        opened = (line.rows >= 0).all(axis=1) & ~closed
        gap = line.on_segments(state.gap, 0.0)[opened] @ lagrange(order, s).T
        if gap.min(initial=0.0) < -GAP_ERROR * reach:
            x = trace.point(*trace.at_places(line.segments[opened], s))[gap.argmin()]
            return f"pair {number} penetrates by {-gap.min():.2g} at ({x[0]:.6g}, {x[1]:.6g})"
        inside = line.segments[closed]
        inside = inside[~np.isin(trace.nodes[inside], tips).any(axis=1)]
        places = trace.at_places(inside, s)
        traction = trace.traction(solution.stress, *places)
        pressure = -(traction * trace.normal(*places)).sum(axis=1)
        if pressure.min(initial=0.0) < -PRESSURE_ERROR * pressure.max(initial=0.0):
            x = trace.point(*places)[pressure.argmin()]
            return f"pair {number} is under tension at ({x[0]:.6g}, {x[1]:.6g})"
    return None
