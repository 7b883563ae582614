"""Displacement and stress at given points, and the elements that these lie in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index, distances_along, joined, rows_of
from ..fem import BoundaryTrace, von_mises
from ..output import COMPONENTS, principal_stresses, stress_tensors
from ..problem import MeshArrays, body_mask, regions_of
from ..quadrature import SampledElements
from ..solved import Solved, full_stress

OUTSIDE = ("error", "nan")
INSIDE_COORDINATE = 1e-9  # barycentric coordinate, negative, up to which a point lies in an element
# ... relative to coordinates over the element's size.
COORDINATE_ROUND_OFF = 64 * np.finfo(float).eps
# Side of an element, in the order of `MeshArrays.sides`, opposite to each of its vertices.
OPPOSITE = {2: [1, 2, 0], 3: [3, 2, 1, 0]}
# Radius of a curved element over that of its vertices: 1.2 on a quarter of a circle.
CURVED_RADIUS = 1.5
STEPS = 30  # of Newton's method; measured: 7 at most on a disc of eight elements
POINTS_AT_ONCE = 20_000  # points at a time


@dataclass(frozen=True, eq=False)
class Location:
    """Elements that contain points, in the order of the points; one on a side lies in both."""

    point: Index  # (q,)
    element: Index  # (q,)
    reference: Array  # (q, d), in NGSolve's reference triangle or tetrahedron


def locate(trace: BoundaryTrace, points: Array) -> Location:
    """Elements that contain `points` (k, d), or lie beside those between the mesh and the CAD."""
    view = MeshArrays(trace.mesh)
    size = np.linalg.norm(np.ptp(view.corners, axis=1), axis=1)
    # Boundary facet (ne, d + 1) opposite to each vertex of an element; -1 inside.
    keys, known = view.keys(view.sides), view.keys(view.facets)
    order = np.argsort(known)
    at = np.minimum(np.searchsorted(known[order], keys), len(known) - 1)
    facet = np.where(known[order][at] == keys, order[at], -1)[:, OPPOSITE[view.dim]]

    def located(at: Index) -> Location:
        """Elements of the points numbered `at` (j,)."""
        point, element = view.near(points[at], CURVED_RADIUS)
        point = at[point]
        reference = _references(trace, view.corners[element], points[point], element)
        share = np.column_stack([reference, 1 - reference.sum(axis=1)])
        noise = COORDINATE_ROUND_OFF * np.abs(points[point]).max(axis=1)
        tolerance = INSIDE_COORDINATE + noise / size[element]
        outside = ~(share >= -tolerance[:, None])  # so a NaN is outside
        inside = ~outside.any(axis=1)
        key = point * len(trace.mesh.GetMaterials()) + view.bodies[element]
        left = np.flatnonzero(~np.isin(key, key[inside]) & (outside.sum(axis=1) == 1))
        side = facet[element[left], outside[left].argmax(axis=1)]
        left, side = left[side >= 0], side[side >= 0]
        tolerance = INSIDE_COORDINATE * trace.lengths(side) + noise[left]
        beside = left[trace.beyond_cad(side, points[point[left]]) <= tolerance]
        rows = np.concatenate([np.flatnonzero(inside), beside])
        rows = rows[np.argsort(point[rows], kind="stable")]
        return Location(point[rows], element[rows], reference[rows])

    chunks = np.array_split(np.arange(len(points)), max(1, -(-len(points) // POINTS_AT_ONCE)))
    return joined([located(at) for at in chunks])


def _references(trace: BoundaryTrace, corners: Array, points: Array, element: Index) -> Array:
    """Places (q, d) of `points` (q, d) in reference elements; `corners` (q, d + 1, d) of these."""
    d = points.shape[1]
    jacobian = (corners[:, :-1] - corners[:, -1:]).transpose(0, 2, 1)
    found = np.linalg.solve(jacobian, (points - corners[:, -1])[:, :, None])
    reference = np.asarray(found[:, :, 0], dtype=float)
    if trace.geometry_order == 1:
        return reference
    near = np.flatnonzero(((reference > -2) & (reference < 3)).all(axis=1))
    reference[np.setdiff1d(np.arange(len(reference)), near)] = np.nan
    mapped = ng.CF(((ng.x, ng.y, ng.z)[:d], ng.specialcf.JacobianMatrix(d, d)))
    elements = SampledElements(trace.mesh, d)
    for _ in range(STEPS):
        if not len(near):
            break
        values = elements.evaluate(mapped, element[near], reference[near, None])[:, 0]
        miss = points[near] - values[:, :d]
        slopes = values[:, d:].reshape(-1, d, d)
        slopes[np.linalg.det(slopes) == 0] = np.nan
        step = np.linalg.solve(slopes, miss[..., None])[..., 0]
        step = np.clip(np.nan_to_num(step), -0.5, 0.5)
        reference[near] = np.clip(reference[near] + step, -2, 3)
        near = near[np.abs(step).max(axis=1) > INSIDE_COORDINATE / 100]
    reference[near] = np.nan  # where elements do not reach
    return reference


@dataclass(frozen=True, eq=False)
class Values:
    """Values of a solution at points of any shape (...,), in any consistent units.

    Attributes
    ----------
    points : ndarray (..., d)
        Where, before deformation.
    body : ndarray of str (...,)
        Name of the body; "" outside of all.
    displacement : ndarray (..., d)
        u_h, lengths.
    tensor : ndarray (..., 3, 3)
        The whole stress; the mean over the elements that meet at the point.
    """

    points: Array
    body: NDArray[np.str_]
    displacement: Array
    tensor: Array

    @property
    def stress(self) -> Array:
        """Stress (..., d, d): in the plane, or all of it."""
        d = self.points.shape[-1]
        return np.asarray(self.tensor[..., :d, :d])

    @property
    def out_of_plane_stress(self) -> Array:
        """Stress normal to the plane (...,), of a body of revolution the hoop stress."""
        if self.points.shape[-1] == 3:
            raise ValueError("solids have no stress out of a plane: .stress has all of it, (3, 3)")
        return np.asarray(self.tensor[..., 2, 2])

    @property
    def von_mises(self) -> Array:
        """Von Mises stress (...,)."""
        return self._where_known(von_mises, ())

    @property
    def principal_stresses(self) -> Array:
        """The three principal stresses (..., 3), the largest first."""
        return self._where_known(principal_stresses, (3,))

    def _where_known(self, function: Callable[[Array], Array], shape: tuple[int, ...]) -> Array:
        """Values (..., *shape) of a `function` of components (k, 6), NaN outside of bodies."""
        known = np.isfinite(self.tensor).all(axis=(-1, -2))
        result = np.full((*self.body.shape, *shape), np.nan)
        rows, columns = np.transpose(COMPONENTS)
        result[known] = function(self.tensor[known][:, rows, columns])
        return result

    @property
    def distance(self) -> Array:
        """Length (k,) of the way along `points` (k, 2) from the first."""
        return distances_along(self.points.reshape(-1, self.points.shape[-1]))

    def columns(self) -> dict[str, NDArray[Any]]:
        """A table by columns (k,), one row a point, as data frames and files are made from."""
        d = self.points.shape[-1]
        s, three = self.tensor.reshape(-1, 3, 3), self.principal_stresses.reshape(-1, 3)
        x, u = self.points.reshape(-1, d), self.displacement.reshape(-1, d)
        return {
            **{name: x[:, i] for i, name in enumerate("xyz"[:d])},
            "body": self.body.ravel(),
            **{f"u{name}": u[:, i] for i, name in enumerate("xyz"[:d])},
            **{f"s{'xyz'[i]}{'xyz'[j]}": s[:, i, j] for i, j in COMPONENTS[: 2 * d]},
            "von_mises": self.von_mises.ravel(),
            **{f"principal_{k + 1}": three[:, k] for k in range(3)},
        }


def values_at(
    solution: Solved, points: Any, body: str | None = None, outside: str = "error"
) -> Values:
    """Values at `points`, (..., d) lengths; see `Solution.at`."""
    if outside not in OUTSIDE:
        raise ValueError(f"outside={outside!r}: choose one of {OUTSIDE}")
    d, stress = solution.problem.dim, full_stress(solution)
    where = _points(points, d)
    flat = where.reshape(-1, d)
    mesh, trace = solution.mesh, solution.discrete.space.trace
    found = _in_bodies(trace, flat, body, outside)
    at = SampledElements(mesh, d).points(found.element, found.reference[:, None]).ravel()
    read = ng.CF((solution.displacement, stress))
    known = np.asarray(read(at)).reshape(-1, read.dim) if len(at) else np.zeros((0, read.dim))
    count = np.bincount(found.point, minlength=len(flat))
    sums = [np.bincount(found.point, column, minlength=len(flat)) for column in known.T]
    with np.errstate(invalid="ignore"):
        means = np.stack(sums, axis=1) / count[:, None]  # 0 / 0 is NaN
    tensor = stress_tensors(means[:, d:])
    tensor[count == 0] = np.nan
    names = np.array([*mesh.GetMaterials(), ""])
    region = np.full(len(flat), -1)
    region[found.point] = MeshArrays(mesh).bodies[found.element]
    shape = where.shape[:-1]
    return Values(
        points=where,
        body=names[region].reshape(shape),
        displacement=means[:, :d].reshape(*shape, d),
        tensor=tensor.reshape(*shape, 3, 3),
    )


def _points(points: Any, d: int) -> Array:
    """Finite coordinates (..., d)."""
    right = f"give an array (k, {d}) of {'x, y and z' if d == 3 else 'x and y'}"
    try:
        where = np.array(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"points={points!r}: {right}") from error
    if where.ndim == 0 or where.shape[-1] != d:
        raise ValueError(f"points have shape {where.shape}: {right}")
    if not np.isfinite(where).all():
        raise ValueError(f"points hold {where[~np.isfinite(where)][0]}: give finite coordinates")
    return where


def _in_bodies(trace: BoundaryTrace, points: Array, body: str | None, outside: str) -> Location:
    """Elements of each of `points` (k, d), all of one body."""
    mesh, view, kept = trace.mesh, MeshArrays(trace.mesh), (found := locate(trace, points))
    names = np.array(mesh.GetMaterials())
    if body is not None:
        [chosen] = regions_of(mesh, "body", [body], body_mask).values()
        kept = rows_of(found, chosen[view.bodies[found.element]])
    missing = np.setdiff1d(np.arange(len(points)), kept.point)
    if len(missing) and outside == "error":
        others = np.unique(names[view.bodies[found.element[found.point == missing[0]]]])
        what = f'body "{body}"' if len(others) else "all bodies"
        where = f', but in "{"|".join(others)}"' if len(others) else ""
        raise ValueError(
            f"{len(missing)} of {len(points)} points lie outside of {what}, the first at "
            f'{_named(points[missing[0]])}{where}: leave them out, or give outside="nan"'
        )
    # Successive incidences of one point in bodies of different names, or without a connection.
    name, piece = names[view.bodies[kept.element]], view.pieces[view.elements[kept.element, 0]]
    two = (name[1:] != name[:-1]) | (piece[1:] != piece[:-1])
    two &= kept.point[1:] == kept.point[:-1]
    if two.any():
        first = kept.point[1:][two][0]
        which = np.unique(name[kept.point == first]).tolist()
        cure = (
            f'choose one of them by body="{which[0]}"'
            if len(which) > 1
            else "give the bodies different names, to choose one of them by body="
        )
        raise ValueError(
            f"the point {_named(points[first])} lies in several bodies, {which}: {cure}"
        )
    return kept


def _named(point: Array) -> str:
    """Coordinates (d,) in words."""
    return f"({', '.join(f'{x:.9g}' for x in point)})"
