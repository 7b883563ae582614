"""The bilateral problem of a known zone: contact with equality where it is closed, none elsewhere.

Where a zone ends too far out or in by t, the gap beside the end is K r^(1/2) + c r^(3/2) + ... with
the distance r from it, and K = 3/2 c t to first order: the end of the contact problem, with K = 0,
is found by Newton's method for each end alone, since the solution depends on t by t^2 only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import ngsolve as ng
import numpy as np

from ..discrete import discretise, minimise_energy
from ..errors import ConvergenceError
from ..lagrange import gauss, lagrange
from ..mesh import check_curves
from ..problem import Problem
from ..solved import Solved
from .geometric_mesh import EndOfContact, GeometricMesh

ELEMENT = "isoparametric"
FIT_DEGREE = 4  # of gap / r^(1/2) in r, over the layers
SAMPLES_PER_NODE = 3  # per node, at which signs are looked at
PRESSURE_ERROR = 1e-3  # of the largest, which is the error of pressures at ends
GAP_ERROR = 1e-6  # of the largest displacement
ROUND_OFF = 1e-6  # of distances on curves, in which ends of segments are compared


def solve_bilateral(problem: Problem, mesh: GeometricMesh, order: int) -> Solved:
    """The solution with contact on the closed segments of a mesh, of degree `order`."""
    curved = mesh.mesh(order)
    check_curves(curved)
    discrete = discretise(problem, curved, order, ELEMENT)
    p, start = discrete.program, 0
    zone = np.zeros(len(p.g), dtype=bool)
    for line in discrete.lines:
        points = line.rows[mesh.closed[line.segments]].ravel()
        zone[start + points[points >= 0]] = True
        start += len(line.node)
    known = replace(p, equality=zone, g=np.where(zone, p.g, np.inf))
    minimiser = minimise_energy(replace(discrete, program=known), zone)
    if not np.array_equal(minimiser.active, zone):
        raise ConvergenceError("contact alone cannot hold a body", iterate=minimiser)
    counts = {
        "assemblies": 1,
        "factorizations": minimiser.factorizations,
        "back_solves": minimiser.back_solves,
        "gap_searches": sum(line.searches for line in discrete.lines),
        "curved_elements": int(np.count_nonzero(discrete.space.trace.curved_segments)),
    }
    return Solved(
        problem=problem,
        mesh=curved,
        order=order,
        element=ELEMENT,
        displacement=discrete.displacement(minimiser.u, discrete.space.right_side),
        discrete=discrete,
        minimiser=minimiser,
        work=counts | dict.fromkeys(("estimates", "equilibrations", "evaluations"), 0),
    )


def excess(solution: Solved, mesh: GeometricMesh, end: EndOfContact) -> float:
    """Length by which a zone ends too far out, by the singular coefficient of the gap there.

    The `solution` is of the `mesh` with layers at its ends.
    """
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
    """Contradiction of contact between nodes: tension in the zone, or penetration; None if none.

    Stresses are not known on segments that end at the vertices `tips` of layers.
    """
    trace, order = solution.discrete.space.trace, solution.order
    s, _ = gauss(2 * SAMPLES_PER_NODE * order)
    stress = ng.BoundaryFromVolumeCF(solution.stress)
    reach = np.abs(solution.displacement.vec.FV().NumPy()).max()
    for number, state in enumerate(solution.pairs):
        line = state.line
        known = np.asarray((line.rows >= 0).all(axis=1))
        points = np.where(known[:, None], line.rows, 0)
        closed = known & state.active[points].all(axis=1)
        opened = np.flatnonzero(known & ~closed)
        gap = state.gap[points[opened]] @ lagrange(order, s).T
        if gap.min(initial=0.0) < -GAP_ERROR * reach:
            at = np.unravel_index(gap.argmin(), gap.shape)
            x = trace.point(line.segments[opened[at[0]]][None], s[at[1]][None])[0]
            return f"pair {number} penetrates by {-gap.min():.2g} at ({x[0]:.6g}, {x[1]:.6g})"
        inside = line.segments[closed]
        inside = inside[~np.isin(trace.nodes[inside], tips).any(axis=1)]
        segment, places = np.repeat(inside, len(s)), np.tile(s, len(inside))
        sigma = trace.evaluate(stress, segment, places).reshape(-1, 2, 2)
        normal = trace.normal(segment, places)
        pressure = -np.einsum("ki,kij,kj->k", normal, sigma, normal)
        if pressure.min(initial=0.0) < -PRESSURE_ERROR * pressure.max(initial=0.0):
            x = trace.point(segment, places)[pressure.argmin()]
            return f"pair {number} is under tension at ({x[0]:.6g}, {x[1]:.6g})"
    return None
