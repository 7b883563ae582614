"""Integrals of any functions, with the error that is left; prescribed values finer than meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from .cells import (
    Cells,
    Integrand,
    divisions,
    extent,
    following,
    joined,
    whole,
    with_corners,
    with_those_beside,
)
from .view import View, looked_at, numbers

EXACT = {1: 15, 2: 10}  # degree of polynomials that the rule on a part integrates
SEEN = {1: 6, 2: 5}  # degree of those that tell its corners from its points
BEYOND = 0.05  # share of a part beyond the last point of the rule
ENOUGH = 2e-7  # error relative to the integral of the size, at which nothing is halved any more
AT_ONCE = 16.0  # parts are halved whose error is that of the worst one over this, or more
MOST = 10_000  # parts that are looked at: jumps along curves leave an error
SMALLEST = 2.0**-38  # of an element: points beside corners of smaller parts are these corners
FEWEST = 8  # points on a segment at least, which show any interpolation error
RESOLVED = 0.1  # what polynomials miss of values, relative to what the mesh does: they are rough
NOISE = 1e-10  # ... and relative to the values
FOLLOWED = 1e-3  # error of the squares on a part, relative to all of them


@lru_cache
def _rule(dim: int) -> tuple[Array, Array, Array]:
    """Points (m, dim) and weights (m,) on the unit segment or triangle, corners at the end.

    Also a matrix (dim + 1, m) to what a polynomial through the others misses at the corners.
    """
    made = ng.IntegrationRule(ng.SEGM if dim == 1 else ng.TRIG, EXACT[dim])
    inner = np.array([p[:dim] for p in made.points]).reshape(-1, dim)
    return with_corners(inner, np.array(made.weights), SEEN[dim])


def _sums(integrand: Integrand, cells: Cells) -> tuple[Array, Array, Array]:
    """Integrals (k, c) of a function over k cells by the rule, of its size, and what is beyond."""
    points, weights, misses = _rule(cells.origin.shape[1])
    values = integrand(cells.element, cells.origin[:, None] + points @ cells.side)
    measure = np.abs(np.linalg.det(cells.side))[:, None]
    weights = (measure * weights)[:, None]
    beyond = BEYOND * measure * np.abs(misses @ values).max(axis=1)
    return (weights @ values)[:, 0], (weights @ np.abs(values))[:, 0], beyond


def integral(integrand: Integrand, cells: Cells, corners: Array | None) -> tuple[Array, Array]:
    """Integral (c,) of a function over `cells`, and the error (c,) that is measured of it.

    That of a part is the difference between it and its halves, or what its points may not see
    if that is more. The worst parts are halved, and what is beside them, first. Errors of smooth
    functions have one sign and add up, others any: the whole error is the sum of the differences,
    which may vanish by chance, or the root of the sum of the squares of the errors.

    Parameters
    ----------
    integrand : function
        Values (k, m, c) at points (k, m, dim) of elements (k,).
    cells : Cells
        To start from.
    corners : ndarray (n, 3, 2), optional
        Of all triangles, lengths.
    """
    dim = cells.origin.shape[1]
    whole, size, beyond = _sums(integrand, cells)
    unit = float(size.sum(axis=0).max(initial=0.0)) or 1.0
    coarse = np.stack([whole, beyond], axis=1) / unit  # (k, 2, c), integrals and what is beyond

    def halved(cells: Cells) -> Array:  # the same of the halves, (k, 2^dim, 2, c)
        whole, _, beyond = _sums(integrand, cells.divided(2))
        found = np.stack([whole, beyond], axis=1) / unit
        return found.reshape(-1, 2**dim, *found.shape[1:])

    halves, seen = halved(cells), len(coarse)
    while True:
        differs = halves[:, :, 0].sum(axis=1) - coarse[:, 0]
        error = np.maximum(np.abs(differs), halves[:, :, 1].sum(axis=1))
        missed = np.maximum(np.abs(differs.sum(axis=0)), np.linalg.norm(error, axis=0))
        large = np.abs(cells.side).max(axis=(1, 2)) > SMALLEST
        worst = np.where(large, error.max(axis=1), 0.0)
        some = worst > worst.max() / AT_ONCE
        if missed.max() <= ENOUGH or not some.any() or seen > MOST:
            return unit * halves[:, :, 0].sum(axis=(0, 1)), unit * missed
        if corners is not None:
            some = large & with_those_beside(some, cells, corners)
        new, parts = cells[some].divided(2), halves[some].reshape(-1, *coarse.shape[1:])
        seen += len(parts)
        cells, coarse = joined([cells[~some], new]), np.concatenate([coarse[~some], parts])
        halves = np.concatenate([halves[~some], halved(new)])


def integral_over(
    density: ng.CoefficientFunction, view: View, elements: Index, rough: Mask | None
) -> tuple[Array, Array]:
    """Integral over `elements` (k,), of which those that are `rough` (n,) begin in parts.

    Returns
    -------
    ndarray (c,)
        The integral.
    ndarray (c,)
        Its error, as of `integral`.
    """
    fine = np.zeros(len(elements), dtype=bool) if rough is None else rough[elements]

    def values(elements: Index, reference: Array) -> Array:
        found = view.evaluate(density, elements, reference)
        return np.asarray(found * view.evaluate(view.measure, elements, reference))

    cells = whole(view.dim, elements[~fine])
    if fine.any():
        cells = joined([cells, view.in_parts(elements[fine])])
    return integral(values, cells, view.arrays.corners if view.dim == 2 else None)


def rough_segments(
    values: Sequence[ng.CoefficientFunction], mesh: ng.Mesh, segments: Index, missed: float
) -> Mask:
    """Which `segments` (k,) have values, scalars, that are not seen at a few points, (k,).

    `missed` is how far a displacement is from them there. Numbers are nowhere rough.
    """
    if all(map(numbers, values)):
        return np.zeros(len(segments), dtype=bool)
    left, largest = np.zeros(mesh.GetNE(ng.BND)), 0.0
    for here, found, beyond in looked_at(ng.CF(tuple(values)), View(mesh, 1), segments, FEWEST):
        left[here] = beyond
        largest = max(largest, float(np.abs(found).max()))
    return np.asarray(left[segments] > max(RESOLVED * missed, NOISE * largest))


def pieces(
    miss: Callable[[Index, Array], Array], mesh: ng.Mesh, sizes: Array, at: Index
) -> tuple[Index, Array, Array]:
    """Pieces on which Gauss points tell a function's squares.

    Segment (n,), start (n,) and length (n,) of each, the latter in [0, 1].

    Parameters
    ----------
    miss : function
        Its values (k, m, c) at parameters (k, m) of segments (k,).
    mesh : ng.Mesh
        The mesh.
    sizes : ndarray (q,)
        Lengths of the segments.
    at : ndarray of int (k,)
        The segments to be taken to pieces.
    """

    def squares(segment: Index, s: Array) -> Array:
        return np.asarray(sizes[segment, None, None] * miss(segment, s[..., 0]) ** 2)

    n = max(FEWEST, int(divisions(1, sizes[at], extent(mesh)).max()))
    cells = whole(1, at).divided(n)
    total = float((cells.weights * squares(cells.element, cells.points).sum(axis=2)).sum())
    cells, *_ = following(squares, cells, FOLLOWED * total)
    return cells.element, cells.origin[:, 0], cells.side[:, 0, 0]
