"""Triangles or segments, sampled: their sizes, functions there; looks at data, counted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index, Mask
from ..problem import MeshArrays
from .cells import INTEGRALS, Cells, lattice, monomials, refined

# Parts of the bodies' extent: a disc, or a length, of a hundredth of it contains a point.
FINEST = {1: 256, 2: 116}
# Of the side of an element: the polynomials miss a step at any of the points by 7 %.
PARTS = {1: (16, 32, 128), 2: (2, 4, 8, 12, 16, 24, 32)}
POINTS = 3  # parts of a lattice that one of the rule is as good as
DEGREE = 6  # of polynomials that the usual rules integrate against displacements
ENOUGH = {1: 1e-8, 2: 1e-6}  # error of a part relative to the integral of the size of a function


class _Count:
    """Points since the start of the process."""

    points = 0


def evaluations() -> int:
    """Points at which data were looked at since the start of the process."""
    return _Count.points


def looked(function: ng.CoefficientFunction, points: NDArray) -> Array:
    """Values (..., c) of a function among the data at mesh `points` (j, n) or (n,), counted."""
    _Count.points += points.size
    return np.asarray(function(points.ravel())).reshape(*points.shape, function.dim)


def divisions(dim: int, sizes: Array, extent: float) -> Index:
    """How many of `PARTS` the side of elements of `sizes` (k,) is divided into, (k,)."""
    finest = np.array(PARTS[dim])
    at = np.searchsorted(finest, sizes * (FINEST[dim] / extent))
    return finest[np.minimum(at, len(finest) - 1)]


@dataclass(frozen=True, eq=False)
class SampledElements:
    """All triangles of a mesh, `dim` 2, or all segments of its boundary, 1."""

    mesh: ng.Mesh
    dim: int

    @cached_property
    def arrays(self) -> MeshArrays:
        """The mesh as arrays."""
        return MeshArrays(self.mesh)

    @property
    def ends(self) -> Index:
        """Vertices (n, dim + 1) of all elements."""
        return self.arrays.elements if self.dim == 2 else self.arrays.facets

    @cached_property
    def sizes(self) -> Array:
        """Diameters or lengths (n,) of all elements."""
        if self.dim == 2:
            return self.arrays.diameters
        ends = self.arrays.vertices[self.ends]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    @property
    def corners(self) -> Array | None:
        """Of all triangles, (n, 3, 2), lengths."""
        return self.arrays.corners if self.dim == 2 else None

    @property
    def measure(self) -> ng.CoefficientFunction:
        """Area or length of an element per unit of its reference element."""
        jacobian = ng.specialcf.JacobianMatrix(2, self.dim)
        return ng.Det(jacobian) if self.dim == 2 else ng.Norm(jacobian)

    def inside(self, region: ng.Region) -> Index:
        """Numbers (k,) of those in a region of the same dimension."""
        number = self.arrays.bodies if self.dim == 2 else self.arrays.boundaries
        return np.flatnonzero(np.array(region.Mask())[number])

    def with_neighbours(self, some: Mask, inside: Index) -> Mask:
        """Mask (n,) of `some` (n,) and of those `inside` (k,) that share a vertex with one."""
        touched = np.zeros(self.mesh.nv, dtype=bool)
        touched[self.ends[some]] = True
        result = some.copy()
        result[inside] |= touched[self.ends[inside]].any(axis=1)
        return result

    @cached_property
    def _middles(self) -> NDArray:
        rule = ng.IntegrationRule([(1 / 3, 1 / 3 if self.dim == 2 else 0.0, 0.0)], [1])
        return self.mesh.MapToAllElements(rule, ng.VOL if self.dim == 2 else ng.BND)

    def points(self, elements: Index, reference: Array) -> NDArray:
        """NGSolve's points (j, n) at `reference` (j, n, dim), or (n, dim), of `elements` (j,)."""
        reference = np.broadcast_to(reference, (len(elements), *reference.shape[-2:]))
        points = self._middles[np.repeat(elements, reference.shape[1])]
        points = points.reshape(reference.shape[:2])
        for axis in range(self.dim):
            points["xy"[axis]] = reference[..., axis]
        return points

    def evaluate(
        self, function: ng.CoefficientFunction, elements: Index, reference: Array
    ) -> Array:
        """Values (j, n, c) at `reference` (j, n, dim), or (n, dim), of `elements` (j,)."""
        points = self.points(elements, reference)
        return np.asarray(function(points.ravel())).reshape(*points.shape, function.dim)

    def look(self, data: ng.CoefficientFunction, elements: Index, reference: Array) -> Array:
        """Values (j, n, c) of `data` at `reference` (j, n, dim) of `elements` (j,), counted."""
        return looked(data, self.points(elements, reference))

    def positions(self, elements: Index, reference: Array) -> Array:
        """Places (j, 2) at a point `reference` (j, dim) of each of `elements` (j,)."""
        return self.evaluate(ng.CF((ng.x, ng.y)), elements, reference[:, None])[:, 0]

    def samples(
        self, function: ng.CoefficientFunction, elements: Index, fewest: int = 0
    ) -> Iterator[tuple[Index, Array]]:
        """Some of `elements` (k,) of about one size, (j,), and values (j, n, c), till all came.

        At points of a `lattice`, `fewest` on a side at least: no disc of a hundredth of the mesh's
        extent falls between them.
        """
        count = divisions(self.dim, self.sizes[elements], self.arrays.extent)
        count = np.maximum(count, fewest)
        for n in np.unique(count).tolist():
            here = elements[count == n]
            yield here, self.look(function, here, lattice(self.dim, n))

    def in_parts(self, elements: Index) -> Cells:
        """The `elements` (k,) in parts, on which rules see what the points of a lattice see."""
        count = divisions(self.dim, self.sizes[elements], self.arrays.extent)
        count = np.maximum(count // POINTS, 2)
        several = np.unique(count).tolist()
        return Cells.joined(
            [Cells.whole(self.dim, elements[count == n]).divided(n) for n in several]
        )

    def integral(
        self, density: ng.CoefficientFunction, elements: Index, rough: Mask | None = None
    ) -> tuple[Array, Array]:
        """Integral (c,) over `elements` (k,), and the error (c,) that is measured of it.

        Those that are `rough` (n,) begin in parts.
        """
        fine = np.zeros(len(elements), dtype=bool) if rough is None else rough[elements]

        def values(elements: Index, reference: Array) -> Array:
            found = self.evaluate(density, elements, reference)
            return np.asarray(found * self.evaluate(self.measure, elements, reference))

        cells = Cells.whole(self.dim, elements[~fine])
        if fine.any():
            cells = Cells.joined([cells, self.in_parts(elements[fine])])
        found = refined(values, cells, INTEGRALS, ENOUGH[self.dim], corners=self.corners)
        return found.integral, found.error


def missed_by_polynomials(values: Array, dim: int) -> Array:
    """What polynomials up to `DEGREE` miss at most, (j,), of `values` (j, n, c) on a lattice."""
    basis = polynomials(dim, round(values.shape[1] ** (1 / dim)))
    return np.abs(values - basis @ (basis.T @ values)).max(axis=(1, 2))


@lru_cache
def polynomials(dim: int, n: int) -> Array:
    """Values (k, q) of orthonormal polynomials at the points of a lattice, fewer than half."""
    x = 2 * lattice(dim, n) - 1
    degree = min({1: n - 2, 2: n - 1}[dim], DEGREE)
    return np.asarray(np.linalg.qr(monomials(x, degree))[0])
