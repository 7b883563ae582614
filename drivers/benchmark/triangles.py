"""Forces and energy of linear triangles, for codes that give displacements only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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
