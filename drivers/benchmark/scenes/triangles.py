"""Sides of triangles; forces and energy of linear ones, for codes that give displacements only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Corners of a triangle that its sides join.
SIDES = [[0, 1], [1, 2], [2, 0]]


def sides(triangles: Indices) -> tuple[Indices, Indices]:
    """End vertices (k, 2) of all sides, each once, and the sides (ne, 3) of the triangles."""
    every = np.sort(triangles[:, SIDES], axis=2).reshape(-1, 2)
    ends, number = np.unique(every, axis=0, return_inverse=True)
    return ends, number.reshape(-1, 3)


def which(ends: Indices, wanted: Indices) -> Indices:
    """Numbers (m,) of the sides that join `wanted` (m, 2) among those that join `ends` (k, 2)."""
    count = ends.max() + 1
    keys, found = (np.sort(pairs, axis=1) @ [count, 1] for pairs in (ends, wanted))
    sorter = np.argsort(keys)
    return sorter[np.searchsorted(keys, found, sorter=sorter)]


def forces(
    points: Array, triangles: Indices, u: Array, lam: float, mu: float
) -> tuple[Array, float]:
    """Nodal forces (n, 2) that hold the displacements u (n, 2), and the strain energy.

    `lam` and `mu` are Lame's moduli of plane strain.
    """
    corners = points[triangles]
    across = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)  # the side opposite
    (ax, ay), (bx, by) = across[:, 0].T, across[:, 1].T
    double_area = ax * by - ay * bx
    slope = np.stack([-across[..., 1], across[..., 0]], axis=2) / double_area[:, None, None]
    gradient = np.einsum("eai,eaj->eij", u[triangles], slope)
    strain = (gradient + gradient.transpose(0, 2, 1)) / 2
    volume = np.trace(strain, axis1=1, axis2=2)
    stress = 2 * mu * strain + lam * volume[:, None, None] * np.eye(2)
    area = double_area / 2
    result = np.zeros_like(u)
    np.add.at(result, triangles, np.einsum("eij,eaj,e->eai", stress, slope, area))
    return result, float(np.einsum("eij,eij,e->", stress, strain, area)) / 2
