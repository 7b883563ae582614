"""Lines of symmetry, at which a picture is mirrored."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array, Mask

STRAIGHT = (
    1e-6  # distance from the line, relative to its length, up to which a boundary is straight
)
ACROSS = 1e-6  # displacement across a line, relative to the largest on it, that is round-off


@dataclass(frozen=True, eq=False)
class SymmetryLine:
    """A straight line.

    Attributes
    ----------
    point : ndarray (2,)
        On it, a length.
    normal : ndarray (2,)
        Unit vector.
    slack : float
        Distance up to which points lie on it, a length.
    """

    point: Array
    normal: Array
    slack: float

    def distance(self, x: Array) -> Array:
        """Signed distances (k,) of points `x` (k, 2)."""
        return np.asarray((x - self.point) @ self.normal)

    def holds(self, x: Array) -> Mask:
        """Which of the points `x` (k, 2) lie on it, (k,)."""
        return np.asarray(np.abs(self.distance(x)) <= self.slack)

    def reflected(self, x: Array) -> Array:
        """Mirror images (k, 2) of points `x` (k, 2)."""
        return np.asarray(x - 2 * self.distance(x)[:, None] * self.normal)


def axis_of(place: Array) -> SymmetryLine:
    """The axis r = 0 of a body of revolution with nodes at `place` (k, 2)."""
    slack = STRAIGHT * float(np.abs(place).max(initial=0.0))
    return SymmetryLine(np.zeros(2), np.array([1.0, 0.0]), slack)


def symmetry_line(mesh: ng.Mesh, displacement: ng.GridFunction, pattern: str) -> SymmetryLine:
    """The line of symmetry on which the boundary `pattern` lies.

    Raises ``ValueError`` where there is no such boundary, it is not on one line, points of it move
    across that line, or bodies lie on both sides of it.
    """
    region = mesh.Boundaries(pattern)
    if not any(region.Mask()):
        names = sorted(set(mesh.GetBoundaries()))
        raise ValueError(f'mirror = "{pattern}" is no boundary; there are {", ".join(names)}')
    rule = ng.IntegrationRule([(0.0, 0, 0), (0.5, 0, 0), (1.0, 0, 0)], [0.0] * 3)
    at = mesh.MapToAllElements(rule, region)
    x = np.asarray(ng.CF((ng.x, ng.y))(at), dtype=float).reshape(-1, 2)
    u = np.asarray(ng.CF(tuple(displacement))(at), dtype=float).reshape(-1, 2)
    middle = x.mean(axis=0)
    _, _, axes = np.linalg.svd(x - middle, full_matrices=False)
    vertices = np.array([v.point for v in mesh.vertices])
    line = SymmetryLine(middle, axes[1], STRAIGHT * float(np.ptp(vertices, axis=0).max()))
    if not line.holds(x).all():
        raise ValueError(f'mirror = "{pattern}" is not straight: give a boundary on one line')
    across = np.abs(u @ line.normal).max()
    if across > ACROSS * np.abs(displacement.vec.FV().NumPy()).max():
        raise ValueError(
            f'mirror = "{pattern}" moves across its line by {across:.3g}: it is no line of symmetry'
        )
    sides = line.distance(vertices)
    if (sides > line.slack).any() and (sides < -line.slack).any():
        raise ValueError(f'mirror = "{pattern}": bodies lie on both sides of its line')
    return line
