"""Which elements of a mesh, curved or not, contain given points."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from scipy.spatial import KDTree

from ..arrays import Array, Index, Mask
from ..fem import BoundaryTrace
from ..problem import Triangulation, triangle_sides
from ..quadrature import mesh_points

INSIDE = 1e-9  # barycentric coordinate, negative, up to which a point lies in an element
ROUND_OFF = 64 * np.finfo(float).eps  # ... relative to coordinates over the element's size
BULGE = 1.5  # radius of a curved element over that of its vertices: 1.2 on a quarter of a circle
STEPS = 30  # of Newton's method; measured: 7 at most on a disc of eight elements
CHUNK = 20_000  # points at a time


@dataclass(frozen=True, eq=False)
class Location:
    """Elements that contain points: q incidences, in the order of the points.

    Attributes
    ----------
    point, element : ndarray of int (q,)
        Which point lies in which element. One on a side lies in both.
    reference : ndarray (q, 2)
        Where, in NGSolve's reference triangle.
    """

    point: Index
    element: Index
    reference: Array

    def of(self, kept: Mask) -> Location:
        """The incidences `kept` (q,)."""
        return Location(self.point[kept], self.element[kept], self.reference[kept])


def locate(trace: BoundaryTrace, points: Array) -> Location:
    """Elements of the mesh of `trace` that contain the `points` (k, 2), lengths.

    A point between the mesh and the CAD curve that bounds the body lies in the element beside it.
    """
    finder = _Finder(trace)
    chunks = np.array_split(np.arange(len(points)), max(1, -(-len(points) // CHUNK)))
    parts = [finder.find(points, at) for at in chunks]
    return Location(
        np.concatenate([part.point for part in parts]),
        np.concatenate([part.element for part in parts]),
        np.concatenate([part.reference for part in parts]),
    )


class _Finder:
    """A mesh, prepared for a search."""

    def __init__(self, trace: BoundaryTrace) -> None:
        self.trace, self.mesh = trace, trace.mesh
        view = Triangulation(trace.mesh)
        self.body = view.bodies
        self.corners, self.curved = view.corners, trace.geometry_order > 1
        middle = self.corners.mean(axis=1)
        radius = np.linalg.norm(self.corners - middle[:, None], axis=2).max(axis=1) * BULGE
        self.size = np.linalg.norm(np.ptp(self.corners, axis=1), axis=1)
        # Elements of about one size at a time: large ones are near many points, small ones few.
        octave = np.frexp(radius)[1]
        groups = [np.flatnonzero(octave == k) for k in np.unique(octave)]
        self.groups = [(at, KDTree(middle[at]), float(radius[at].max())) for at in groups]
        self.segment = self._segments(view)

    def _segments(self, view: Triangulation) -> Index:
        """Boundary segment (ne, 3) opposite to each vertex of an element; -1 inside."""
        keys = np.sort(triangle_sides(view.triangles), axis=1) @ [self.mesh.nv, 1]
        known = np.sort(view.segments, axis=1) @ [self.mesh.nv, 1]
        order = np.argsort(known)
        at = np.minimum(np.searchsorted(known[order], keys), len(known) - 1)
        found = np.where(known[order][at] == keys, order[at], -1)
        return found.reshape(-1, 3)[:, [1, 2, 0]]  # sides 01, 12, 20 lie opposite to 2, 0, 1

    def find(self, points: Array, at: Index) -> Location:
        """Elements of the points numbered `at` (j,) among `points` (k, 2)."""
        point, element = self._candidates(points[at])
        point = at[point]
        reference = self._references(points[point], element)
        share = np.column_stack([reference, 1 - reference.sum(axis=1)])
        tolerance = INSIDE + ROUND_OFF * np.abs(points[point]).max(axis=1) / self.size[element]
        outside = ~(share >= -tolerance[:, None])  # so a NaN is outside
        inside = ~outside.any(axis=1)
        key = point * len(self.mesh.GetMaterials()) + self.body[element]
        left = np.flatnonzero(~np.isin(key, key[inside]) & (outside.sum(axis=1) == 1))
        side = self.segment[element[left], outside[left].argmax(axis=1)]
        left, side = left[side >= 0], side[side >= 0]
        beside = left[self._within_curves(points[point[left]], side)]
        rows = np.concatenate([np.flatnonzero(inside), beside])
        rows = rows[np.argsort(point[rows], kind="stable")]
        return Location(point[rows], element[rows], reference[rows])

    def _candidates(self, points: Array) -> tuple[Index, Index]:
        """Points (q,) and elements (q,) near them, of `points` (j, 2)."""
        found: list[tuple[Index, Index]] = [(np.zeros(0, dtype=np.intp),) * 2]
        for numbers, middles, radius in self.groups if len(points) else ():
            pairs = KDTree(points).sparse_distance_matrix(middles, radius, output_type="coo_matrix")
            found.append((pairs.row.astype(np.intp), numbers[pairs.col]))
        point, element = (np.concatenate(part) for part in zip(*found, strict=True))
        return point, element

    def _references(self, points: Array, element: Index) -> Array:
        """Places (q, 2) of `points` (q, 2) in the reference triangles of elements (q,)."""
        a, b, c = np.moveaxis(self.corners[element], 1, 0)
        jacobian = np.stack([a - c, b - c], axis=2)
        reference = np.linalg.solve(jacobian, (points - c)[:, :, None])[:, :, 0]
        if not self.curved:
            return reference
        near = np.flatnonzero(((reference > -2) & (reference < 3)).all(axis=1))
        reference[np.setdiff1d(np.arange(len(reference)), near)] = np.nan
        mapped = ng.CF((ng.x, ng.y, ng.specialcf.JacobianMatrix(2, 2)))
        for _ in range(STEPS):
            if not len(near):
                break
            at = mesh_points(self.mesh, element[near], reference[near, None])
            values = np.asarray(mapped(at.ravel())).reshape(-1, 6)
            miss = points[near] - values[:, :2]
            with np.errstate(all="ignore"):
                step = _solved(values[:, 2:].reshape(-1, 2, 2), miss)
            step = np.clip(np.nan_to_num(step), -0.5, 0.5)
            reference[near] = np.clip(reference[near] + step, -2, 3)
            near = near[np.abs(step).max(axis=1) > INSIDE / 100]
        reference[near] = np.nan  # where elements do not reach
        return reference

    def _within_curves(self, points: Array, segment: Index) -> Mask:
        """Whether `points` (j, 2) beyond segments (j,) lie within the CAD curve, (j,)."""
        trace, edges = self.trace, self.trace.edges or []
        within = np.zeros(len(points), dtype=bool)
        outward = trace.normal(segment, np.full(len(segment), 0.5))
        for region in np.unique(trace.region[segment]) if edges else ():
            edge = edges[region]
            at = np.flatnonzero(trace.region[segment] == region)
            if edge.straight:
                continue
            normal = edge.normal(points[at])
            normal *= np.sign((normal * outward[at]).sum(axis=1))[:, None]
            off = ((points[at] - edge.point(edge.project(points[at]))) * normal).sum(axis=1)
            scale = np.abs(points[at]).max(axis=1)
            within[at] = off <= INSIDE * trace.lengths(segment[at]) + ROUND_OFF * scale
        return within


def _solved(matrices: Array, right: Array) -> Array:
    """Solutions (q, 2) of systems with `matrices` (q, 2, 2) and `right` (q, 2) sides."""
    (a, b), (c, d) = np.moveaxis(matrices, 0, 2)
    x, y = right.T
    return np.stack([d * x - b * y, a * y - c * x], axis=1) / (a * d - b * c)[:, None]
