"""Polish a solution: its ends of contact become vertices of a coarse mesh of high order.

Contact takes all smoothness away from a solution but at the ends of its zone, and at corners. On a
mesh that is graded geometrically towards them (hp version), with vertices that follow the ends,
errors fall exponentially with the order.
"""

from __future__ import annotations

import logging
import math

import numpy as np

from ..adaptivity import END_POWER, RefinementTree, corners
from ..arrays import Array, Mask, field_names
from ..errors import ContactError, warn
from ..fem import BoundaryTrace, boundary_trace, model_of
from ..mesh import cad_edges
from ..problem import MeshArrays, Problem
from ..solution import Solution
from ..solved import Solved
from .bilateral import excess, solve_bilateral, wrong_signs
from .geometric_mesh import LAYER_RATIO, GeometricMesh, coarse_mesh, isolated

MAX_DIGITS = 12
ORDERS = (4, 6, 8, 10)
MAX_STEPS = 8  # of Newton's method, at one order
STEP_TOLERANCE = 1e-2  # of the size of elements at the ends: how closely these are found at order 4
MAX_STEP = 0.3  # of the segments beside, by which an end may move in a step
MIN_LAYERS = 2
PLACE_DISTANCE = 1e-9  # of the extent, up to which two places are one
RIGHT_ANGLE_ERROR = 1e-3  # radians by which a right angle may differ from one
BLUNT_ANGLE = 0.5  # radians by which a convex corner turns at least
USUAL_RATIO = 0.1  # ratio of two changes from order to order; measured: 0.02 to 0.1
MAX_RATIO = 0.8  # ... of what hardly converges

log = logging.getLogger("ngcontact")


class _NotPolishedError(Exception):
    """Why a solution is returned unchanged."""


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
    except (_NotPolishedError, ContactError, ValueError, np.linalg.LinAlgError) as error:
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
        raise _NotPolishedError(
            f"a mesh with vertices at its {count} ends of contact was not found; refine first"
        )
    end_layers, corner_layers = _layers(problem, mesh, digits)
    values, error = list[Array](), math.inf
    for order in ORDERS:
        final = False
        for step in range(MAX_STEPS):
            graded = mesh
            for vertex, layers in [
                *((end.vertex, end_layers) for end in mesh.ends),
                *corner_layers,
            ]:
                graded = graded.with_layers(vertex, layers)
            polished = solve_bilateral(problem, graded, order)
            if step == 0 and order > ORDERS[0]:
                error = _error([*values, _quantities(polished)])
                final = error <= 10.0**-digits or order == ORDERS[-1]
            share, mesh = _followed(mesh, polished, graded, end_layers)
            log.info(
                "polish: order %d, %d unknowns, ends off by %.1e of elements, error %.1e",
                order,
                polished.displacement.space.ndof,
                share,
                error,
            )
            if share <= (10.0 ** (2 - digits) if final else STEP_TOLERANCE):
                break
        else:
            raise _NotPolishedError(f"its ends of contact do not settle at order {order}")
        values.append(_quantities(polished))
        if final:
            break
    if not error < math.sqrt(10.0**-digits):
        raise _NotPolishedError(
            f"orders {ORDERS} do not converge: they leave errors of {error:.1e}"
        )
    if (wrong := wrong_signs(polished)) is not None:
        raise _NotPolishedError(wrong)
    if error > 10.0**-digits:
        warn(f"polish: order {order} has about {-math.log10(error):.0f} digits, not {digits}")
    mesh_of = polished.mesh
    kept = {name: getattr(polished, name) for name in field_names(polished)}
    return Solution(**kept, tree=RefinementTree(mesh_of, np.arange(mesh_of.ne)))


def _quantities(solution: Solved) -> Array:
    """What is to converge: the forces of all pairs and the energy, (q,)."""
    forces = [solution.contact_force(k) for k in range(len(solution.pairs))]
    return np.append(np.concatenate(forces), solution.energy)


def _error(values: list[Array]) -> float:
    """Relative error of the last of the values of orders, if changes go on to fall as they did."""
    size = np.abs(values[-1])
    size[:-1] = size[:-1].max()
    changes = (np.abs(np.diff(values, axis=0)) / size).max(axis=1)
    ratio = USUAL_RATIO if len(changes) == 1 else min(changes[-1] / changes[-2], MAX_RATIO)
    return float(changes[-1] * ratio / (1 - ratio))


def _followed(
    mesh: GeometricMesh, solution: Solved, graded: GeometricMesh, layers: int
) -> tuple[float, GeometricMesh]:
    """The mesh with its ends moved to where they belong, and the largest share that they moved.

    Of the segments beside them.
    """
    largest, moved = 0.0, mesh
    for end in mesh.ends:
        beside = mesh.vertices[[end.closed, end.opened]] - mesh.vertices[end.vertex]
        size = float(np.linalg.norm(beside, axis=1).min())
        share = -excess(solution, graded, end, layers) / size
        largest = max(largest, abs(share))
        moved = moved.moved(end, size * float(np.clip(share, -MAX_STEP, MAX_STEP)))
    return largest, moved


def _layers(
    problem: Problem, mesh: GeometricMesh, digits: int
) -> tuple[int, list[tuple[int, int]]]:
    """Layers at ends of contact, and at other vertices where singularities are: vertex, number."""
    trace = boundary_trace(mesh.source, 1, model_of(problem))
    found, regular = corners(problem, trace), _regular_corners(problem, trace, mesh)
    least = digits / (2 * math.log10(1 / LAYER_RATIO))  # the squared error falls with h^(2 power)
    faced = {int(k): vertex for vertex, k in enumerate(mesh.partner) if k >= 0}
    layers = dict[int, int]()
    for place, power in zip(found.places, found.powers, strict=True):
        distance = np.linalg.norm(mesh.vertices - place, axis=1)
        for vertex in np.flatnonzero(
            (distance <= PLACE_DISTANCE * distance.max()) & ~regular
        ).tolist():
            one = faced.get(vertex, vertex)  # both have them
            layers[one] = max(layers.get(one, 0), math.ceil(least / power))
    return max(MIN_LAYERS, round(least / END_POWER)), list(layers.items())


def _regular_corners(problem: Problem, trace: BoundaryTrace, mesh: GeometricMesh) -> Mask:
    """Vertices (nv,) at which conditions change without a singularity worth of layers.

    Right angles at a guide, a line of symmetry: their mirror image has no corner. And convex
    corners between sides that tractions or nothing act on.
    """
    every = np.arange(len(trace.region))
    normal = trace.exact_normal(every, np.full(len(every), 0.5))
    guide = trace.lies_on(every, None if problem.sliding is None else str(problem.sliding))
    held = guide.copy()
    for name, given in problem.displacement.items():
        on, axes = trace.lies_on(every, name), [k for k in (0, 1) if given[k] is not None]
        held |= on
        if len(axes) == 1:
            guide |= on & (np.abs(normal[:, axes[0]]) > 1 - RIGHT_ANGLE_ERROR**2)
    touching = np.unique(mesh.segments[mesh.closed])
    touching = np.union1d(touching, mesh.partner[touching])
    natural = ~held & ~np.isin(mesh.segments, touching).all(axis=1)
    straight = (
        ~trace.curved_segments
        if trace.edges is None
        else np.array([trace.edges[k].straight for k in trace.region])
    )
    regular = np.zeros(len(mesh.vertices), dtype=bool)
    convex = MeshArrays(mesh.source).angles < np.pi - BLUNT_ANGLE
    outer = np.flatnonzero(~trace.inner)
    for vertex in np.unique(mesh.segments[outer])[:]:
        at = outer[(mesh.segments[outer] == vertex).any(axis=1)]
        if len(at) == 2 and convex[vertex]:
            s = (mesh.segments[at, 1] == vertex).astype(float)
            one, other = trace.exact_normal(at, s)
            mirrored = (guide & straight)[at].any() and abs(one @ other) < RIGHT_ANGLE_ERROR
            regular[vertex] = mirrored or natural[at].all()
    return regular
