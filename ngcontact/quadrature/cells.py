"""Triangles and segments of a mesh, sampled, and in parts that are halved until a rule suffices."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, joined, root_of_squares, rows_of
from ..problem import POSITION, MeshArrays, region_mask

# Halvings of the sides: points beside corners of smaller parts are these.
MAX_HALVINGS = {1: 38, 2: 10}
MOST_CELLS = 20_000  # parts that are halved at a time: rougher functions are noise
CORNER_POINT_DISTANCE = 1e-4  # distance of the points at corners from these, relative to a part
RULE_MARGIN = 0.05  # share of a part beyond the last point of the rule
GOLDEN = (1 + 5**0.5) / 2  # takes points on a line out of step with waves

# Parts of the bodies' extent: a disc, or a length, of a hundredth of it contains a point.
LATTICE_DIVISIONS = {1: 256, 2: 116}
# Of the side of an element: the polynomials miss a step at any of the points by 7 %.
SIDE_PARTS = {1: (16, 32, 128), 2: (2, 4, 8, 12, 16, 24, 32)}
POINTS = 3  # parts of a lattice that one of the rule is as good as
DEGREE = 6  # of polynomials that the usual rules integrate against displacements
# Error of a part relative to the integral of the size of a function.
INTEGRAL_ERROR = {1: 1e-8, 2: 1e-6}

# Orders of the rules on a part, and the degree of the polynomial through their points that tells
# their corners: of loads, whose moments are taken again, and of integrals that are wanted as such.
MOMENTS = {1: (7, 3), 2: (4, 2)}
INTEGRALS = {1: (15, 6), 2: (10, 5)}

COUNTED = {"points": 0}  # by `sampled`

Integrand = Callable[[Index, Array], Array]  # values (k, m, c) at (k, m, dim) of elements (k,)


@lru_cache
def parts(dim: int, n: int) -> tuple[Array, Array]:
    """The k = n^dim equal parts of the unit simplex: origins (k, dim), sides (k, dim, dim)."""
    if dim == 1:
        return np.arange(n)[:, None] / n, np.full((n, 1, 1), 1 / n)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright, turned = i + j < n, i + j < n - 1
    origin = np.concatenate(
        [np.column_stack([i, j])[upright], np.column_stack([i + 1, j + 1])[turned]]
    )
    side = np.repeat([1.0, -1.0], [upright.sum(), turned.sum()])[:, None, None] * np.eye(2)
    return origin / n, side / n


@lru_cache
def lattice(dim: int, n: int) -> Array:
    """A point in each of the k = n^dim parts, (k, dim): their middles, on a line out of step."""
    origin, side = parts(dim, n)
    if dim == 1:
        return origin + (0.25 + 0.5 * (GOLDEN * np.arange(n)[:, None] % 1)) / n
    return np.asarray(origin + side.sum(axis=1) / 3)


def monomials(x: Array, degree: int) -> Array:
    """Products of the coordinates up to a degree at points `x` (..., dim), (..., q)."""
    found = [np.ones(x.shape[:-1])]  # each by one product, in the order of degrees
    for d in range(1, degree + 1):
        first = [x[..., 0] * previous for previous in found[-d if x.shape[-1] == 2 else -1 :]]
        found += first + ([x[..., 1] * found[-1]] if x.shape[-1] == 2 else [])
    return np.stack(found, axis=-1)


def gauss_rule(dim: int, order: int) -> tuple[Array, Array]:
    """Points (m, dim) and weights (m,) of NGSolve's rule on the unit segment or triangle."""
    rule = ng.IntegrationRule(ng.SEGM if dim == 1 else ng.TRIG, order)
    return np.array([p[:dim] for p in rule.points]).reshape(-1, dim), np.array(rule.weights)


def inward(points: Array) -> Array:
    """Places (m, dim): `points` (m, dim) moved by `CORNER_POINT_DISTANCE` of the way inwards."""
    return points + CORNER_POINT_DISTANCE * (1 / (points.shape[1] + 1) - points)


@lru_cache
def composite(n: int, order: int) -> ng.IntegrationRule:
    """Rule of an order on each of n^2 equal parts of a triangle."""
    points, weights = gauss_rule(2, order)
    origin, side = parts(2, n)
    x = (origin[:, None] + points @ side).reshape(-1, 2)
    return ng.IntegrationRule(
        [(a, b, 0.0) for a, b in x.tolist()], np.tile(weights / n**2, n**2).tolist()
    )


@dataclass(frozen=True, eq=False)
class Rule:
    """A rule on the unit simplex with its corners as last points, of weight 0."""

    points: Array  # (m, dim)
    weights: Array  # (m,)
    # (dim + 1, m) from values to what a polynomial through the inner points misses at the corners:
    # steps beyond the last point are seen there.
    misses: Array

    @staticmethod
    @lru_cache
    def of(dim: int, order: int, degree: int) -> Rule:
        """NGSolve's rule of an order, with corners and polynomials of a degree."""
        inner, weights = gauss_rule(dim, order)
        corners = inward(np.vstack([np.zeros(dim), np.eye(dim)]))
        through = monomials(corners, degree) @ np.linalg.pinv(monomials(inner, degree))
        misses = np.hstack([-through, np.eye(dim + 1)])
        return Rule(np.vstack([inner, corners]), np.append(weights, np.zeros(dim + 1)), misses)


@dataclass(frozen=True, eq=False)
class ElementParts:
    """Parts of elements, k of them."""

    element: Index  # (k,), the element of each
    origin: Array  # (k, dim), reference coordinates of a corner
    side: Array  # (k, dim, dim), sides from there, as rows

    @staticmethod
    def whole(dim: int, elements: Index) -> ElementParts:
        """The `elements` (k,) themselves."""
        size = len(elements)
        return ElementParts(elements, np.zeros((size, dim)), np.tile(np.eye(dim), (size, 1, 1)))

    def points(self, rule: Rule) -> Array:
        """Points of a rule, (k, m, dim), in reference coordinates of the elements."""
        return self.origin[:, None] + rule.points @ self.side

    def weights(self, rule: Rule) -> Array:
        """Weights of a rule, (k, m)."""
        return np.abs(np.linalg.det(self.side))[:, None] * rule.weights

    def divided(self, n: int) -> ElementParts:
        """Each in n^dim equal parts, one after the other."""
        origin, side = parts(self.origin.shape[1], n)
        return ElementParts(
            np.repeat(self.element, len(origin)),
            (self.origin[:, None] + origin @ self.side).reshape(-1, *origin.shape[1:]),
            (side @ self.side[:, None]).reshape(-1, *side.shape[1:]),
        )

    def beside(self, some: Mask, corners: Array) -> Mask:
        """The cells `some` (k,) and those that may touch one, (k,); `corners` (n, 3, 2) of all."""
        of = corners[self.element]
        sides = self.side @ (of[:, :2] - of[:, 2:])
        origin = of[:, 2] + (self.origin[:, None] @ (of[:, :2] - of[:, 2:]))[:, 0]
        middle = origin + sides.sum(axis=1) / 3
        ends = np.concatenate([origin[:, None], origin[:, None] + sides], axis=1)
        radius = np.linalg.norm(ends - middle[:, None], axis=2).max(axis=1)
        apart, nearest = cKDTree(middle[some]).query(middle)
        return np.asarray(apart <= radius + radius[some][nearest])


@dataclass(frozen=True, eq=False)
class Refined:
    """Parts of elements, k of them, on which a rule integrates a function of c components."""

    cells: ElementParts
    rule: Rule  # of m points on each
    values: Array  # (k, m, c), the function at its points
    missed: Array  # (k,), error over a part that is halved no more although it is too large, else 0
    # (c,) of the whole integral: errors of smooth functions have one sign and add up, others any.
    # The sum of differences, which may vanish by chance, or the root of the sum of squares, or what
    # is allowed of a part if any was halved, as a jump may be missed in it.
    error: Array


def refined(
    integrand: Integrand,
    cells: ElementParts,
    rules: dict[int, tuple[int, int]],
    share: float,
    total: float | None = None,
    corners: Array | None = None,
) -> Refined:
    """Parts of `cells` on which a rule, of `MOMENTS` or `INTEGRALS`, integrates a function.

    Parts are halved until their integrals and those over their halves differ by no more than a
    share of the total, that of the function's size by the first parts when left out. What is beside
    one that is halved is halved, too, where the `corners` (n, 3, 2) of all triangles tell: it may
    hold the rest of what is there without any of the points.
    """
    dim = cells.origin.shape[1]
    rule = Rule.of(dim, *rules[dim])
    found, kept, missed, differences, errors = [], [], [], [], []

    def integrals(cells: ElementParts) -> tuple[Array, Array]:
        """Values (k, m, c), and integrals and what may lie beyond the points (k, 2, c)."""
        values, weights = integrand(cells.element, cells.points(rule)), cells.weights(rule)
        beyond = np.abs(rule.misses @ values).max(axis=1) * weights.sum(axis=1)[:, None]
        return values, np.stack([(weights[:, None] @ values)[:, 0], RULE_MARGIN * beyond], axis=1)

    values, coarse = integrals(cells)
    if total is None:
        total = float((cells.weights(rule) * np.abs(values).sum(axis=2)).sum())
    allowed = share * total
    for depth in range(MAX_HALVINGS[dim]):
        halves = cells.divided(2)
        values, fine = integrals(halves)
        differs = fine[:, 0].reshape(len(coarse), 2**dim, -1).sum(axis=1) - coarse[:, 0]
        sizes = np.maximum(np.abs(differs), coarse[:, 1])
        error = sizes.max(axis=1)
        last = depth == MAX_HALVINGS[dim] - 1 or np.count_nonzero(error > allowed) > MOST_CELLS
        some = (error > allowed) & (not last)
        if corners is not None and some.any():
            some = cells.beside(some, corners)
        again = np.repeat(some, 2**dim)
        found.append(rows_of(halves, ~again))
        kept.append(values[~again])
        over = np.where(error > allowed, error, 0.0) * last / 2**dim
        missed.append(np.repeat(over, 2**dim)[~again])
        differences.append(differs[~some])
        errors.append(sizes[~some])
        cells, coarse = rows_of(halves, again), fine[again]
        if not len(coarse):
            break
    sums = np.abs(np.concatenate(differences).sum(axis=0))
    roots = np.array([root_of_squares(column) for column in np.concatenate(errors).T])
    return Refined(
        joined(found),
        rule,
        np.concatenate(kept),
        np.concatenate(missed),
        np.maximum(np.maximum(sums, roots), allowed if len(found) > 1 else 0.0),
    )


def local_functions(space: ng.FESpace, numbers: Index) -> ng.CoefficientFunction:
    """The q functions of each of n elements of a discontinuous space, (q,), by `numbers` (n, q)."""
    functions = [ng.GridFunction(space) for _ in numbers.T]
    for function, own in zip(functions, numbers.T, strict=True):
        function.vec.FV().NumPy()[own] = 1.0
    return ng.CF(tuple(functions))


def evaluations() -> int:
    """Points at which data were looked at since the start of the process."""
    return COUNTED["points"]


def sampled(function: ng.CoefficientFunction, points: NDArray) -> Array:
    """Values (..., c) of a function among the data at mesh `points` (j, n) or (n,), counted."""
    COUNTED["points"] += points.size
    return np.asarray(function(points.ravel())).reshape(*points.shape, function.dim)


def divisions(dim: int, sizes: Array, extent: float) -> Index:
    """Number (k,) of `SIDE_PARTS` into which the sides of elements of `sizes` (k,) are divided."""
    finest = np.array(SIDE_PARTS[dim])
    at = np.searchsorted(finest, sizes * (LATTICE_DIVISIONS[dim] / extent))
    return finest[np.minimum(at, len(finest) - 1)]


@dataclass(frozen=True, eq=False)
class SampledElements:
    """All triangles of a mesh, `dim` 2, or all segments of its boundary, 1.

    Points and values are those of tetrahedra, too, with `dim` 3, and of their boundary, 2.
    """

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
        """Corners of all triangles, (n, 3, 2), lengths."""
        return self.arrays.corners if self.dim == 2 else None

    @property
    def measure(self) -> ng.CoefficientFunction:
        """Area or length of an element per unit of its reference element."""
        jacobian = ng.specialcf.JacobianMatrix(2, self.dim)
        return ng.Det(jacobian) if self.dim == 2 else ng.Norm(jacobian)

    def inside(self, region: ng.Region) -> Index:
        """Numbers (k,) of those in a region of the same dimension."""
        return np.flatnonzero(region_mask(region)[self._region])

    @property
    def _region(self) -> Index:
        return self.arrays.bodies if self.dim == 2 else self.arrays.boundaries

    @property
    def names(self) -> NDArray[np.str_]:
        """Name (n,) of the region of each."""
        mesh = self.mesh
        return np.array(mesh.GetMaterials() if self.dim == 2 else mesh.GetBoundaries())[
            self._region
        ]

    def with_neighbours(self, some: Mask, inside: Index) -> Mask:
        """Mask (n,) of `some` (n,) and of those `inside` (k,) that share a vertex with one."""
        touched = np.zeros(self.mesh.nv, dtype=bool)
        touched[self.ends[some]] = True
        result = some.copy()
        result[inside] |= touched[self.ends[inside]].any(axis=1)
        return result

    @cached_property
    def _middles(self) -> NDArray:
        middle = [*[1 / (self.dim + 1)] * self.dim, *[0.0] * (3 - self.dim)]
        kind = ng.VOL if self.dim == self.mesh.dim else ng.BND
        return self.mesh.MapToAllElements(ng.IntegrationRule([middle], [1]), kind)

    def points(self, elements: Index, reference: Array) -> NDArray:
        """NGSolve's points (j, n) at `reference` (j, n, dim), or (n, dim), of `elements` (j,)."""
        reference = np.broadcast_to(reference, (len(elements), *reference.shape[-2:]))
        points = self._middles[np.repeat(elements, reference.shape[1])]
        points = points.reshape(reference.shape[:2])
        for axis in range(self.dim):
            points["xyz"[axis]] = reference[..., axis]
        return points

    def evaluate(
        self, function: ng.CoefficientFunction, elements: Index, reference: Array
    ) -> Array:
        """Values (j, n, c) at `reference` (j, n, dim), or (n, dim), of `elements` (j,)."""
        points = self.points(elements, reference)
        return np.asarray(function(points.ravel())).reshape(*points.shape, function.dim)

    def sample(self, data: ng.CoefficientFunction, elements: Index, reference: Array) -> Array:
        """Values (j, n, c) of `data` at `reference` (j, n, dim) of `elements` (j,), counted."""
        return sampled(data, self.points(elements, reference))

    def positions(self, elements: Index, reference: Array) -> Array:
        """Places (j, 2) at a point `reference` (j, dim) of each of `elements` (j,)."""
        return self.evaluate(POSITION, elements, reference[:, None])[:, 0, :2]

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
            yield here, self.sample(function, here, lattice(self.dim, n))

    def in_parts(self, elements: Index) -> ElementParts:
        """The `elements` (k,) in parts, on which rules see what the points of a lattice see."""
        count = divisions(self.dim, self.sizes[elements], self.arrays.extent)
        count = np.maximum(count // POINTS, 2)
        several = np.unique(count).tolist()
        whole = (ElementParts.whole(self.dim, elements[count == n]) for n in several)
        return joined([cells.divided(n) for cells, n in zip(whole, several, strict=True)])

    def integral(
        self, density: ng.CoefficientFunction, elements: Index, rough: Mask | None = None
    ) -> tuple[Array, Array]:
        """Integral (c,) over `elements` (k,), and its error (c,); `rough` (n,) begin in parts."""
        fine = np.zeros(len(elements), dtype=bool) if rough is None else rough[elements]

        def values(elements: Index, reference: Array) -> Array:
            found = self.evaluate(density, elements, reference)
            return np.asarray(found * self.evaluate(self.measure, elements, reference))

        cells = ElementParts.whole(self.dim, elements[~fine])
        if fine.any():
            cells = joined([cells, self.in_parts(elements[fine])])
        found = refined(values, cells, INTEGRALS, INTEGRAL_ERROR[self.dim], corners=self.corners)
        return np.einsum("km,kmc->c", found.cells.weights(found.rule), found.values), found.error


def missed_by_polynomials(values: Array, dim: int) -> Array:
    """Largest errors (j,) of polynomials up to `DEGREE` in `values` (j, n, c) on a lattice."""
    basis = polynomials(dim, round(values.shape[1] ** (1 / dim)))
    return np.abs(values - basis @ (basis.T @ values)).max(axis=(1, 2))


@lru_cache
def polynomials(dim: int, n: int) -> Array:
    """Values (k, q) of orthonormal polynomials at the points of a lattice, fewer than half."""
    x = 2 * lattice(dim, n) - 1
    return np.asarray(np.linalg.qr(monomials(x, min(n - 3 + dim, DEGREE)))[0])
