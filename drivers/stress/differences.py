"""What the solution of a moved problem misses of the image of the first one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.stress.motion import Motion
from ngcontact import Solution

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# On the curve, or at the points, of the secondary: not the same when the bodies are swapped.
ON_SECONDARY = ("estimate", "indicators", "relative", "transitions")


def _displacement(solution: Solution) -> Array:
    """Displacements (nv, 2) of the vertices."""
    return solution.displacement.vec.FV().NumPy().reshape(2, -1)[:, : solution.mesh.nv].T


def _sides_swapped(first: Solution, other: Solution) -> bool:
    return first.problem.contact[0].secondary != other.problem.contact[0].secondary


def _directions(solution: Solution) -> Array:
    return np.concatenate([line.direction for line in solution.discrete.lines])


def _same_points(first: Solution, other: Solution, motion: Motion) -> tuple[Index, Index]:
    """Numbers in both solutions of the contact points that are the same.

    Of swapped bodies they are so if they face each other; means are taken on the secondary.
    """
    origin, size = first.points[:1], np.ptp(first.points, axis=0).max()
    x = (motion.place(first.points) - motion.place(origin)) / (motion.length * size)
    y = (other.points - motion.place(origin)) / (motion.length * size)
    here, there = _directions(first) @ motion.turn.T, _directions(other)
    if _sides_swapped(first, other):
        here = -here
        if other.problem.contact[0].direction is not None:  # only the place across it counts
            x, y = (z - (z * there[0]).sum(axis=1)[:, None] * there[0] for z in (x, y))
    distance, number = cKDTree(np.column_stack([y, there])).query(np.column_stack([x, here]))
    same = np.flatnonzero(distance < 1e-6)
    if _sides_swapped(first, other):
        same = same[~(_means(first)[same] | _means(other)[number[same]])]
    return same, number[same]


def _means(solution: Solution) -> NDArray[np.bool_]:
    """Contact points (m,) whose row is a mean over segments."""
    return np.concatenate([pair.line.means for pair in solution.pairs])


def _all_compared(first: Solution, other: Solution, same: Index, number: Index) -> bool:
    """Whether only points without force are not; bodies that are not swapped miss none."""
    if not _sides_swapped(first, other):
        return len(same) == len(np.unique(number)) == len(first.points) == len(other.points)
    counts = np.count_nonzero(first.active), np.count_nonzero(other.active)
    return counts == (first.active[same].sum(), other.active[np.unique(number)].sum())


def differences(
    first: Solution, other: Solution, motion: Motion, vertex: Index, triangle: Index
) -> dict[str, float]:
    """What `other` misses of the image of `first`, each relative to the largest of its kind.

    Infinite where active sets, steps or the number of transitions differ.
    """
    same, number = _same_points(first, other, motion)
    size = motion.length * motion.load
    stress, force = motion.modulus * motion.load, motion.modulus * motion.load * motion.length
    estimate = math.sqrt(motion.modulus) * size
    sign = -1 if _sides_swapped(first, other) else 1
    length = np.ptp(first.points, axis=0).max()
    u = np.abs(_displacement(first)).max()
    gap = max(u, first.gap.max())

    def off(value: Array, image: Array, scale: float) -> float:
        return float(np.abs(value - image).max(initial=0.0) / scale)

    def right(value: bool | np.bool_) -> float:
        return 0.0 if value else math.inf

    result = {
        "points": right(_all_compared(first, other, same, number)),
        "active": right((other.active[number] == first.active[same]).all()),
        # Coordinates that are rounded otherwise, and gaps that are data, decide otherwise which
        # points are the nearest.
        "steps": right(
            other.steps == first.steps
            or np.abs(motion.shift).max() > 1
            or motion.load != 1
            or sign < 0
        ),
        "displacement": off(
            _displacement(other)[vertex] / size, _displacement(first) @ motion.turn.T, u
        ),
        "pressure": off(
            other.pressure[number] / stress, first.pressure[same], first.pressure.max()
        ),
        "gap": off(other.gap[number] / size, first.gap[same], gap),
        "force": off(
            sign * other.contact_force() / force,
            first.contact_force() @ motion.turn.T,
            float(np.linalg.norm(first.contact_force())),
        ),
        "energy": _off_energy(other.energy, first.energy * force * size),
        "estimate": abs(other.error_estimate / estimate / first.error_estimate - 1),
        # What is left where the stresses of neighbours cancel.
        "indicators": off(
            other.indicators[triangle] / estimate, first.indicators, first.energy_norm
        ),
        "relative": abs(other.relative_error_estimate / first.relative_error_estimate - 1),
    }
    result["transitions"] = _apart(first.transitions(), other.transitions(), motion, length)
    if sign < 0:  # these are taken on the curve and at the points of the secondary
        result = {name: result[name] for name in result if name not in ON_SECONDARY}
    return {name: value if value == value else math.inf for name, value in result.items()}


def _off_energy(energy: float, right: float) -> float:
    """Relative difference; energies beyond the range of numbers are 0 or infinite."""
    return 0.0 if energy == right else abs(energy / right - 1) if right else math.inf


def _apart(ends: Array, images: Array, motion: Motion, length: float) -> float:
    """Distance of the transitions `images` from those of the first solution over `length`."""
    if len(ends) != len(images):
        return math.inf
    if len(ends) == 0:
        return 0.0
    origin = motion.place(ends[:1])
    distance, _ = cKDTree(images - origin).query(motion.place(ends) - origin)
    return float(distance.max() / (motion.length * length))
