"""Displacement and stress at given points, and the elements that these lie in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..arrays import Array, Index, Mask, joined, rows_of
from ..fem import BoundaryTrace, von_mises
from ..output import full_stress, principal_stresses
from ..problem import MeshArrays, body_mask, regions_of
from ..quadrature import SampledElements
from ..solved import Solved

OUTSIDE = ("error", "nan")
INSIDE = 1e-9  # barycentric coordinate, negative, up to which a point lies in an element
ROUND_OFF = 64 * np.finfo(float).eps  # ... relative to coordinates over the element's size
BULGE = 1.5  # radius of a curved element over that of its vertices: 1.2 on a quarter of a circle
STEPS = 30  # of Newton's method; measured: 7 at most on a disc of eight elements
CHUNK = 20_000  # points at a time


@dataclass(frozen=True, eq=False)
class Location:
    """Elements that contain points, in the order of the points; one on a side lies in both."""

    point: Index  # (q,)
    element: Index  # (q,)
    reference: Array  # (q, 2), in NGSolve's reference triangle


def locate(trace: BoundaryTrace, points: Array) -> Location:
    """Elements of the mesh of `trace` that contain the `points` (k, 2), lengths.

    A point between the mesh and the CAD curve that bounds the body lies in the element beside it.
    """
    finder = _Finder(trace)
    chunks = np.array_split(np.arange(len(points)), max(1, -(-len(points) // CHUNK)))
    return joined([finder.find(points, at) for at in chunks])


class _Finder:
    """A mesh, prepared for a search."""

    def __init__(self, trace: BoundaryTrace) -> None:
        self.trace, self.mesh = trace, trace.mesh
        view = MeshArrays(trace.mesh)
        self.body = view.bodies
        self.corners, self.curved = view.corners, trace.geometry_order > 1
        middle = self.corners.mean(axis=1)
        radius = np.linalg.norm(self.corners - middle[:, None], axis=2).max(axis=1) * BULGE
        self.size = np.linalg.norm(np.ptp(self.corners, axis=1), axis=1)
        # Elements of about one size at a time: large ones are near many points, small ones few.
        octave = np.frexp(radius)[1]
        groups = [np.flatnonzero(octave == k) for k in np.unique(octave)]
        self.groups = [(at, KDTree(middle[at]), float(radius[at].max())) for at in groups]
        # Boundary segment (ne, 3) opposite to each vertex of an element; -1 inside.
        keys, known = view.keys(view.sides), view.keys(view.facets)
        order = np.argsort(known)
        at = np.minimum(np.searchsorted(known[order], keys), len(known) - 1)
        found = np.where(known[order][at] == keys, order[at], -1)
        self.segment = found[:, [1, 2, 0]]  # sides 01, 12, 20 lie opposite to 2, 0, 1

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
        triangles = SampledElements(self.mesh, 2)
        for _ in range(STEPS):
            if not len(near):
                break
            values = triangles.evaluate(mapped, element[near], reference[near, None])[:, 0]
            miss = points[near] - values[:, :2]
            (p, q, r, t), (mx, my) = (
                values[:, 2:].T,
                miss.T,
            )  # the Jacobian matrix, by Cramer's rule
            with np.errstate(all="ignore"):
                step = np.stack([t * mx - q * my, p * my - r * mx], axis=1)
                step /= (p * t - q * r)[:, None]
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


@dataclass(frozen=True, eq=False)
class Values:
    """Values of a solution at points of any shape (...,), in any consistent units.

    Attributes
    ----------
    points : ndarray (..., 2)
        Where, before deformation.
    body : ndarray of str (...,)
        Name of the body; "" outside of all.
    displacement : ndarray (..., 2)
        u_h, lengths.
    stress : ndarray (..., 2, 2)
        In the plane; the mean over the elements that meet at the point.
    out_of_plane_stress : ndarray (...,)
        Stress normal to the plane; of a body of revolution the hoop stress.
    """

    points: Array
    body: NDArray[np.str_]
    displacement: Array
    stress: Array
    out_of_plane_stress: Array

    @property
    def _components(self) -> Array:
        """Stresses xx, yy, xy, zz (k, 4)."""
        (xx, xy), (_, yy) = np.moveaxis(self.stress.reshape(-1, 2, 2), 0, 2)
        return np.stack([xx, yy, xy, self.out_of_plane_stress.ravel()], axis=1)

    @property
    def von_mises(self) -> Array:
        """Von Mises stress (...,)."""
        known = self.body.ravel() != ""
        result = np.full(known.shape, np.nan)
        result[known] = von_mises(self._components[known])
        return result.reshape(self.body.shape)

    @property
    def principal_stresses(self) -> Array:
        """The three principal stresses (..., 3), the largest first."""
        return principal_stresses(self._components).reshape(*self.body.shape, 3)

    @property
    def distance(self) -> Array:
        """Length (k,) of the way along `points` (k, 2) from the first."""
        steps = np.diff(self.points.reshape(-1, 2), axis=0)
        return np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])

    def columns(self) -> dict[str, NDArray[Any]]:
        """A table by columns (k,), one row a point, as data frames and files are made from."""
        x, u = self.points.reshape(-1, 2), self.displacement.reshape(-1, 2)
        columns: dict[str, NDArray[Any]] = {"x": x[:, 0], "y": x[:, 1], "body": self.body.ravel()}
        columns |= {"ux": u[:, 0], "uy": u[:, 1]}
        columns |= dict(zip(("sxx", "syy", "sxy", "szz"), self._components.T, strict=True))
        columns["von_mises"] = self.von_mises.ravel()
        three = self.principal_stresses.reshape(-1, 3)
        return columns | {f"principal_{k + 1}": three[:, k] for k in range(3)}


def values_at(
    solution: Solved, points: Any, body: str | None = None, outside: str = "error"
) -> Values:
    """Values at `points`, (..., 2) lengths; see `Solution.at`."""
    solution.problem.refuse_solids("Solution.at")
    if outside not in OUTSIDE:
        raise ValueError(f"outside={outside!r}: choose one of {OUTSIDE}")
    where, stress = _points(points), full_stress(solution)
    flat = where.reshape(-1, 2)
    mesh, trace = solution.mesh, solution.discrete.space.trace
    found = _in_bodies(trace, flat, body, outside)
    at = SampledElements(mesh, 2).points(found.element, found.reference[:, None]).ravel()
    u = solution.displacement
    read = ng.CF((u[0], u[1], stress))
    known = np.asarray(read(at)).reshape(-1, 6) if len(at) else np.zeros((0, 6))
    count = np.bincount(found.point, minlength=len(flat))
    sums = [np.bincount(found.point, column, minlength=len(flat)) for column in known.T]
    with np.errstate(invalid="ignore"):
        ux, uy, xx, yy, xy, zz = np.stack(sums) / count  # 0 / 0 is NaN
    names = np.array([*mesh.GetMaterials(), ""])
    region = np.full(len(flat), -1)
    region[found.point] = MeshArrays(mesh).bodies[found.element]
    shape = where.shape[:-1]
    return Values(
        points=where,
        body=names[region].reshape(shape),
        displacement=np.stack([ux, uy], axis=-1).reshape(*shape, 2),
        stress=np.stack([xx, xy, xy, yy], axis=-1).reshape(*shape, 2, 2),
        out_of_plane_stress=zz.reshape(shape),
    )


def _points(points: Any) -> Array:
    """Finite coordinates (..., 2)."""
    try:
        where = np.array(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"points={points!r}: give an array (k, 2) of x and y") from error
    if where.ndim == 0 or where.shape[-1] != 2:
        raise ValueError(f"points have shape {where.shape}: give an array (k, 2) of x and y")
    if not np.isfinite(where).all():
        raise ValueError(f"points hold {where[~np.isfinite(where)][0]}: give finite coordinates")
    return where


def _in_bodies(trace: BoundaryTrace, points: Array, body: str | None, outside: str) -> Location:
    """Elements of each of `points` (k, 2), all of one body."""
    mesh, view, kept = trace.mesh, MeshArrays(trace.mesh), (found := locate(trace, points))
    names = np.array(mesh.GetMaterials())
    if body is not None:
        [chosen] = regions_of(mesh, "body", [body], body_mask).values()
        kept = rows_of(found, chosen[view.bodies[found.element]])
    missing = np.setdiff1d(np.arange(len(points)), kept.point)
    if len(missing) and outside == "error":
        x, y = points[missing[0]]
        others = np.unique(names[view.bodies[found.element[found.point == missing[0]]]])
        what = f'body "{body}"' if len(others) else "all bodies"
        where = f', but in "{"|".join(others)}"' if len(others) else ""
        raise ValueError(
            f"{len(missing)} of {len(points)} points lie outside of {what}, the first at "
            f'({x:.9g}, {y:.9g}){where}: leave them out, or give outside="nan"'
        )
    # Successive incidences of one point in bodies of different names, or without a connection.
    name, piece = names[view.bodies[kept.element]], view.pieces[view.elements[kept.element, 0]]
    two = (name[1:] != name[:-1]) | (piece[1:] != piece[:-1])
    two &= kept.point[1:] == kept.point[:-1]
    if two.any():
        first = kept.point[1:][two][0]
        (x, y), which = points[first], np.unique(name[kept.point == first]).tolist()
        cure = (
            f'choose one of them by body="{which[0]}"'
            if len(which) > 1
            else "give the bodies different names, to choose one of them by body="
        )
        raise ValueError(f"the point ({x:.9g}, {y:.9g}) lies in several bodies, {which}: {cure}")
    return kept
