"""Tractions of the two sides of a contact line, as residuals of the estimate."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index
from ..contact import ContactLine, partners
from ..fem import BoundaryTrace
from ..lagrange import gauss_lobatto
from .terms import BoundaryResidual, PressureShare


def traction(
    trace: BoundaryTrace, stress: ng.CoefficientFunction, segment: Index, s: Array
) -> Array:
    """Traction (k, 2) at boundary points; `stress` (2, 2) is that of the body."""
    values = trace.evaluate(ng.BoundaryFromVolumeCF(stress), segment, s).reshape(-1, 2, 2)
    return np.einsum("kij,kj->ki", values, trace.normal(segment, s))


class Side:
    """One body's tractions at the points `at` of a contact line, per unit of s (P1) or eta (P2).

    The last axis of `along` and `across` is the traction sigma_h n and that of a unit pressure.
    """

    def __init__(
        self,
        trace: BoundaryTrace,
        stress: ng.CoefficientFunction,
        direction: Sequence[float] | None,
        at: Index,
        segment: Index,
        s: Array,
        d: Array,
        pi: Array,
    ) -> None:
        self.at, self.segment, self.s = at, segment, s
        self.weight = np.ones(len(s))  # of squares
        self.element = trace.element[segment]
        normal = trace.normal(segment, s)
        self.stretch = np.ones(len(s))  # ds per that unit
        if direction is not None:
            self.stretch = 1 / np.abs((normal * d).sum(axis=1))
        t = np.stack([traction(trace, stress, segment, s), normal], axis=2)
        t *= self.stretch[:, None, None]
        self.along = np.einsum("kij,ki->kj", t, d)
        self.across = t - d[:, :, None] * self.along[:, None, :]
        self.along[:, 0] += pi

    def tangential(self) -> BoundaryResidual:
        """The traction across the direction of contact."""
        share = PressureShare(np.arange(len(self.at)), self.segment, self.s, self.across[..., 1])
        return BoundaryResidual(
            "tangential", self.element, self.weight, self.across[..., 0], [share]
        )

    def pressure(self, other: Side, full: NDArray[np.bool_], least: Array) -> BoundaryResidual:
        """The traction along it plus pi_h; half the difference of both sides where in contact.

        `full` and `least`, whether and with which weight that holds, are over all points.
        """
        mine, theirs = np.arange(len(self.at)), np.zeros(0, dtype=np.intp)
        if other is not self:
            _, mine, theirs = np.intersect1d(
                self.at, other.at[full[other.at]], assume_unique=True, return_indices=True
            )
            theirs = np.flatnonzero(full[other.at])[theirs]
        value, weight = self.along.copy(), self.weight.copy()
        shares = []
        if other is not self:
            weight[mine] = least[self.at[mine]]
            value[mine] /= 2
            value[mine, 0] += other.along[theirs, 0] / 2
            factor = other.along[theirs, 1:] / 2
            shares.append(PressureShare(mine, other.segment[theirs], other.s[theirs], factor))
        shares.append(PressureShare(np.arange(len(self.at)), self.segment, self.s, value[:, 1:]))
        return BoundaryResidual("pressure", self.element, weight, value[:, :1], shares)


def met_from_behind(trace: BoundaryTrace, line: ContactLine) -> Index:
    """Segments of the primary whose middle faces the secondary, (q,)."""
    middle = np.full(len(line.facing), 0.5)
    x = trace.point(line.facing, middle)
    if line.contact.direction is None:
        d = trace.normal(line.facing, middle)
    else:
        d = np.tile(-np.array(line.contact.direction), (len(x), 1))
    back, *_ = partners(trace, line.segments, line.facing, x, d)
    return line.facing[back >= 0]


def pressure_at_nodes(line: ContactLine, pressure: Array, order: int) -> Array:
    """Pressure (k, order + 1) at the nodes of each segment.

    At a node without a row, an end of Gamma_K on Gamma_u, the polynomial through the others.
    """
    values = np.append(pressure, 0.0)[line.rows]
    for k in np.flatnonzero((line.rows < 0).any(axis=1) & line.faces):
        nodes = gauss_lobatto(order)
        known = line.rows[k] >= 0
        if known.any():
            fit = np.polynomial.Polynomial.fit(nodes[known], values[k, known], known.sum() - 1)
            values[k, ~known] = fit(nodes[~known])
    return values
