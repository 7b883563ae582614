"""Triangles or segments: their sizes, functions there; looks at data, which are counted."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index, Mask
from ..problem import MeshArrays
from .cells import Cells, divisions, joined, lattice, mesh_points, monomials, whole

POINTS = {1: 3, 2: 3}  # parts of a lattice that one of the rule is as good as
DEGREE = 6  # of polynomials that the usual rules integrate against displacements
LONG = 4000  # of what is printed; numbers are short
KNOWN: WeakKeyDictionary[ng.CoefficientFunction, bool] = WeakKeyDictionary()  # numbers or not
# What NGSolve prints of numbers, also times others and times the normal.
NUMBER = r"[-+.\de]+"
NUMBERS = re.compile(
    rf"ZeroCoefficientFunction|\s*({NUMBER}\*\()?"
    rf"(coef (unary operation ' '|VectorialCoefficientFunction|ZeroCF|{NUMBER}|"
    rf"scale {NUMBER}|scalar-vector multiply|normal vector), real(, dim=\d+)?)?\s*\)?\s*"
)


def numbers(data: ng.CoefficientFunction) -> bool:
    """Whether data are made of numbers alone: these are nowhere rough. Looked at once."""
    if data not in KNOWN:  # printing a long expression costs as much as evaluating it
        text = str(data)
        lines = text.splitlines() if len(text) < LONG else [text]
        KNOWN[data] = len(text) < LONG and all(map(NUMBERS.fullmatch, lines))
    return KNOWN[data]


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


@dataclass(frozen=True, eq=False)
class View:
    """All triangles of a mesh, `dim` 2, or all segments of its boundary, 1."""

    mesh: ng.Mesh
    dim: int

    @cached_property
    def arrays(self) -> MeshArrays:
        """The mesh as arrays."""
        return MeshArrays(self.mesh)

    @cached_property
    def extent(self) -> float:
        """Largest extent of the mesh along x or y, a length."""
        return float(np.ptp(self.arrays.vertices, axis=0).max())

    def inside(self, region: ng.Region) -> Index:
        """Numbers (k,) of those in a region of the same dimension."""
        number = self.arrays.bodies if self.dim == 2 else self.arrays.boundaries
        return np.flatnonzero(np.array(region.Mask())[number])

    def with_neighbours(self, some: Mask, inside: Index) -> Mask:
        """Mask (n,) of `some` (n,) and of those `inside` (k,) that share a vertex with one."""
        ends = self.arrays.elements if self.dim == 2 else self.arrays.facets
        touched = np.zeros(self.mesh.nv, dtype=bool)
        touched[ends[some]] = True
        result = some.copy()
        result[inside] |= touched[ends[inside]].any(axis=1)
        return result

    @cached_property
    def sizes(self) -> Array:
        """Diameters or lengths (n,) of all elements."""
        if self.dim == 2:
            return MeshArrays(self.mesh).diameters
        ends = self.arrays.vertices[self.arrays.facets]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    @property
    def measure(self) -> ng.CoefficientFunction:
        """Area or length of an element per unit of its reference element."""
        jacobian = ng.specialcf.JacobianMatrix(2, self.dim)
        return ng.Det(jacobian) if self.dim == 2 else ng.Norm(jacobian)

    def evaluate(
        self, function: ng.CoefficientFunction, elements: Index, reference: Array
    ) -> Array:
        """Values (j, n, c) at `reference` (j, n, dim), or (n, dim), of `elements` (j,)."""
        points = self._points(elements, reference)
        return np.asarray(function(points.ravel())).reshape(*points.shape, function.dim)

    def look(self, data: ng.CoefficientFunction, elements: Index, reference: Array) -> Array:
        """Values (j, n, c) of `data` at `reference` (j, n, dim) of `elements` (j,), counted."""
        return looked(data, self._points(elements, reference))

    def _points(self, elements: Index, reference: Array) -> NDArray:
        """NGSolve's points (j, n)."""
        reference = np.broadcast_to(reference, (len(elements), *reference.shape[-2:]))
        return mesh_points(self.mesh, elements, reference)

    def in_parts(self, elements: Index) -> Cells:
        """The `elements` (k,) in parts, on which rules see what the points of a lattice see."""
        count = divisions(self.dim, self.sizes[elements], self.extent)
        count = np.maximum(count // POINTS[self.dim], 2)
        several = np.unique(count).tolist()
        return joined([whole(self.dim, elements[count == n]).divided(n) for n in several])

    def shapes(self, degree: int) -> tuple[ng.FESpace, ng.CoefficientFunction]:
        """Discontinuous polynomials, and the functions of an element, numbered one by one."""
        space = (ng.L2 if self.dim == 2 else ng.SurfaceL2)(self.mesh, order=degree)
        number = math.comb(degree + self.dim, self.dim)
        functions = []
        for j in range(number):
            functions.append(ng.GridFunction(space))
            functions[-1].vec.FV().NumPy()[j::number] = 1.0
        return space, ng.CF(tuple(functions))

    def as_monomials(self, shapes: ng.CoefficientFunction, elements: Index, degree: int) -> Array:
        """Matrices (j, q, q) from the monomials of 2x - 1 to the q functions of `elements` (j,)."""
        i = np.arange(degree + 1) / degree
        x = np.stack(np.meshgrid(*self.dim * [i], indexing="ij"), axis=-1).reshape(-1, self.dim)
        x = x[x.sum(axis=1) < 1 + 0.5 / degree]  # one point for each
        values = self.evaluate(shapes, elements, x)
        return np.asarray(np.linalg.solve(monomials(2 * x - 1, degree), values))

    def mass(self, shapes: ng.CoefficientFunction, elements: Index, order: int) -> Array:
        """Integrals (j, q, q) of the products of an element's q functions over `elements` (j,)."""
        rule = ng.IntegrationRule(ng.SEGM if self.dim == 1 else ng.TRIG, order)
        points = np.array([p[: self.dim] for p in rule.points]).reshape(-1, self.dim)
        shape = self.evaluate(shapes, elements, points)
        weights = np.array(rule.weights)[:, None] * self.evaluate(self.measure, elements, points)
        return np.asarray(np.swapaxes(shape * weights, 1, 2) @ shape)


@lru_cache
def polynomials(dim: int, n: int) -> Array:
    """Values (k, q) of orthonormal polynomials at the points of a lattice, fewer than half of them.

    Of degree up to `DEGREE`: what is left of values without them is rough.
    """
    x = 2 * lattice(dim, n) - 1
    degree = min({1: n - 2, 2: n - 1}[dim], DEGREE)
    return np.asarray(np.linalg.qr(monomials(x, degree))[0])


def looked_at(
    function: ng.CoefficientFunction, view: View, elements: Index, fewest: int = 0
) -> Iterator[tuple[Index, Array, Array]]:
    """Elements (j,), values (j, n, c) there, and (j,) what polynomials miss of these at most.

    Parameters
    ----------
    function : ng.CoefficientFunction
        Of c components.
    view : View
        Of the elements.
    elements : ndarray of int (k,)
        Which.
    fewest : int
        Parts of their sides at least.
    """
    count = divisions(view.dim, view.sizes[elements], view.extent)
    count = np.maximum(count, fewest)
    for n in np.unique(count).tolist():
        here = elements[count == n]
        values = view.look(function, here, lattice(view.dim, n))
        basis = polynomials(view.dim, n)
        yield here, values, np.abs(values - basis @ (basis.T @ values)).max(axis=(1, 2))
