"""Displacement and stress at given points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index, Mask
from ..fem import BoundaryTrace, von_mises
from ..output import full_stress
from ..problem import Triangulation, body_mask, body_of_vertex, regions_of
from ..quadrature import mesh_points
from ..solved import Solved
from .location import Location, locate

OUTSIDE = ("error", "nan")


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
    def von_mises(self) -> Array:
        """Von Mises stress (...,)."""
        components = [self.stress[..., i, j] for i, j in ((0, 0), (1, 1), (0, 1))]
        stress = np.stack([*components, self.out_of_plane_stress], axis=-1)
        return _nowhere_nan(von_mises, stress.reshape(-1, 4)).reshape(self.body.shape)

    @property
    def principal_stresses(self) -> Array:
        """The three principal stresses (..., 3), the largest first."""
        half = (self.stress[..., 0, 0] - self.stress[..., 1, 1]) / 2
        mean = (self.stress[..., 0, 0] + self.stress[..., 1, 1]) / 2
        radius = np.hypot(half, self.stress[..., 0, 1])
        three = np.stack([mean + radius, mean - radius, self.out_of_plane_stress], axis=-1)
        return np.asarray(-np.sort(-three, axis=-1))

    @property
    def distance(self) -> Array:
        """Length (k,) of the way along `points` (k, 2) from the first."""
        steps = np.diff(self.points.reshape(-1, 2), axis=0)
        return np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])

    def columns(self) -> dict[str, NDArray[Any]]:
        """A table by columns (k,), one row a point, as data frames and files are made from."""
        s, three = self.stress.reshape(-1, 2, 2), self.principal_stresses.reshape(-1, 3)
        x, u = self.points.reshape(-1, 2), self.displacement.reshape(-1, 2)
        return {
            **{"x": x[:, 0], "y": x[:, 1], "body": self.body.ravel()},
            **{"ux": u[:, 0], "uy": u[:, 1]},
            **{"sxx": s[:, 0, 0], "syy": s[:, 1, 1], "sxy": s[:, 0, 1]},
            "szz": self.out_of_plane_stress.ravel(),
            "von_mises": self.von_mises.ravel(),
            **{f"principal_{k + 1}": three[:, k] for k in range(3)},
        }


def _nowhere_nan(function: Any, stress: Array) -> Array:
    """A function of stresses (k, 4), and NaN where they are."""
    known = np.isfinite(stress).all(axis=1)
    result = np.full(len(stress), np.nan)
    result[known] = function(stress[known])
    return result


def values_at(
    solution: Solved, points: Any, body: str | None = None, outside: str = "error"
) -> Values:
    """Values at `points`, (..., 2) lengths; see `Solution.at`."""
    if outside not in OUTSIDE:
        raise ValueError(f"outside={outside!r}: choose one of {OUTSIDE}")
    where, stress = _points(points), full_stress(solution)
    flat = where.reshape(-1, 2)
    mesh, trace = solution.mesh, solution.discrete.space.trace
    found = _in_bodies(trace, flat, body, outside)
    at = mesh_points(mesh, found.element, found.reference[:, None]).ravel()
    u = solution.displacement
    read = ng.CF((u[0], u[1], stress))
    known = np.asarray(read(at)).reshape(-1, 6) if len(at) else np.zeros((0, 6))
    count = np.bincount(found.point, minlength=len(flat))
    sums = [np.bincount(found.point, column, minlength=len(flat)) for column in known.T]
    with np.errstate(invalid="ignore"):
        ux, uy, xx, yy, xy, zz = np.stack(sums) / count  # 0 / 0 is NaN
    names = np.array([*mesh.GetMaterials(), ""])
    region = np.full(len(flat), -1)
    region[found.point] = Triangulation(mesh).bodies[found.element]
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
    mesh, found = trace.mesh, locate(trace, points)
    names, region = mesh.GetMaterials(), Triangulation(mesh).bodies
    if body is not None:
        [chosen] = regions_of(mesh, "body", [body], body_mask).values()
        kept = found.of(chosen[region[found.element]])
    else:
        kept = found
    missing = np.setdiff1d(np.arange(len(points)), kept.point)
    if len(missing) and outside == "error":
        x, y = points[missing[0]]
        others = {names[region[k]] for k in found.element[found.point == missing[0]]}
        what = f'body "{body}"' if others else "all bodies"
        where = f', but in "{"|".join(sorted(others))}"' if others else ""
        raise ValueError(
            f"{len(missing)} of {len(points)} points lie outside of {what}, the first at "
            f'({x:.9g}, {y:.9g}){where}: leave them out, or give outside="nan"'
        )
    _refuse_ambiguous(mesh, points, kept, [names[k] for k in region[kept.element]])
    return kept


def _refuse_ambiguous(mesh: ng.Mesh, points: Array, found: Location, names: list[str]) -> None:
    """Refuse points in several bodies, by `names` of each incidence or by connection."""
    piece = body_of_vertex(mesh)[Triangulation(mesh).triangles[found.element, 0]]
    _, name = np.unique(names, return_inverse=True)
    two = _differ(found.point, name) | _differ(found.point, piece)
    if not two.any():
        return
    first = found.point[1:][two][0]
    x, y = points[first]
    which = sorted({names[k] for k in np.flatnonzero(found.point == first)})
    cure = (
        f'choose one of them by body="{which[0]}"'
        if len(which) > 1
        else "give the bodies different names, to choose one of them by body="
    )
    raise ValueError(f"the point ({x:.9g}, {y:.9g}) lies in several bodies, {which}: {cure}")


def _differ(point: Index, label: Index) -> Mask:
    """Where successive incidences of one point (q,) have different labels (q,), (q - 1,)."""
    return np.asarray((np.diff(point) == 0) & (np.diff(label) != 0))
