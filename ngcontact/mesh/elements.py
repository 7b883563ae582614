"""Sizes and middles of elements."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..problem import Triangulation


def diameters(mesh: ng.Mesh) -> Array:
    """Longest side of each triangle, (ne,), lengths."""
    corners = Triangulation(mesh).corners
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def middles(mesh: ng.Mesh) -> NDArray:
    """Mesh points (ne,) in the middle of each element."""
    return mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)
