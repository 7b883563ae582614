"""Residuals on the boundary, before and after the pressure correction."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array, Index


@dataclass(frozen=True, eq=False)
class PressureShare:
    """What delta at n points of the boundary adds to residuals: `factor` (n, c) times it.

    Attributes
    ----------
    at : ndarray of int (n,)
        Numbers of the residuals.
    segment, s : ndarray (n,)
        Where delta counts.
    factor : ndarray (n, c)
        Its factor in each component of the residual.
    """

    at: Index
    segment: Index
    s: Array
    factor: Array


@dataclass(frozen=True, eq=False)
class BoundaryResidual:
    """Squared residuals at k points of the boundary, linear in the corrected pressure.

    Attributes
    ----------
    name : str
        Part of the estimate.
    element : ndarray of int (k,)
        Element each point counts for.
    weight : ndarray (k,)
        Factor of its square.
    residual : ndarray (k, c)
        The residual of sigma_h.
    shares : list of PressureShare
        How the residual changes with delta.
    """

    name: str
    element: Index
    weight: Array
    residual: Array
    shares: list[PressureShare]
