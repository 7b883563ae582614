"""Quadrature that follows the data of a gap."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.polynomial.legendre import legvander

from ...arrays import Array, Index
from ...contact import ContactLine, Pieces, prescribed_gap
from ...fem import BoundaryTrace
from ...lagrange import gauss

UNRESOLVED = 0.1  # distance of a gap from polynomials over its range, from which it is followed
GAP_NOISE = 1e-12  # ... relative to the gap, below which there is none
DIVIDED = 4  # parts of a piece whose gap is followed
PARTS = 100_000  # pieces looked at, from which no more are divided


def following_gap(boundary: BoundaryTrace, line: ContactLine, pieces: Pieces, order: int) -> Pieces:
    """Pieces divided until `gap` data are polynomials on each, by its Gauss points of `order`.

    Or until `PARTS` are reached. Gaps between measured curves are resolved by those.
    """
    gap, rule = line.contact.gap, gauss(order)[0]
    if gap is None or isinstance(gap, float) or len(pieces.local) == 0:
        return pieces
    ends = np.concatenate([[0.0], rule, [1.0]])
    between = (ends[1:] + ends[:-1]) / 2
    basis = [legvander(2 * s - 1, len(rule) - 1) for s in (rule, between)]
    follow = basis[1] @ np.linalg.inv(basis[0])
    done, number = [], 0

    while len(pieces.local):
        length = pieces.stop - pieces.start
        segment = line.segments[pieces.local]
        at_rule, at_between = (
            _gap_at(boundary, line, segment, pieces.start[:, None] + length[:, None] * s)
            for s in (rule, between)
        )
        number += len(pieces.local)
        low, high = (f(at_rule, axis=1) for f in (np.min, np.max))
        allowed = UNRESOLVED * (high - low) + GAP_NOISE * np.abs(at_rule).max()
        rough = np.abs(at_between - at_rule @ follow.T).max(axis=1) > allowed
        rough &= number < PARTS
        done.append(_select(pieces, np.flatnonzero(~rough)))
        pieces = _select(pieces, np.repeat(np.flatnonzero(rough), DIVIDED))
        step = (pieces.stop - pieces.start) / DIVIDED
        start = pieces.start + step * np.tile(np.arange(DIVIDED), rough.sum())
        pieces = replace(pieces, start=start, stop=start + step)
    if len(done) == 1:
        return done[0]
    parts = {name.name: [getattr(x, name.name) for x in done] for name in fields(Pieces)}
    found = Pieces(**{name: np.concatenate(values) for name, values in parts.items()})
    return _select(found, np.lexsort((found.start, found.local)))


def _select(pieces: Pieces, at: Index) -> Pieces:
    """Pieces of the numbers `at` (n,)."""
    return Pieces(**{name.name: getattr(pieces, name.name)[at] for name in fields(Pieces)})


def _gap_at(boundary: BoundaryTrace, line: ContactLine, segment: Index, s: Array) -> Array:
    """Data of the gap (r, n) at `s` (r, n) of segments (r,), lengths."""
    every, where = np.repeat(segment, s.shape[1]), s.ravel()
    x = boundary.point(every, where)
    return prescribed_gap(line.contact, boundary, every, where, x).reshape(s.shape)
