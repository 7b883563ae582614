"""The exact boundary curves of an OCC geometry: positions, tangents, projections.

Netgen hands out one CAD edge for each boundary region of a two-dimensional mesh, in the same
order. Everything here is in the edge's own parameter; arrays of points are (k, 2).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry, TopoDS_Shape

from ..arrays import Array, Index, across, newton, rightward

SAMPLES = 65  # points of an edge from which a projection starts
LEVEL_DISTANCE = 1e-9  # distance, relative to the edge, beyond which a level counts as not reached
STRAIGHT = 1e-12  # distance from the chord, relative to the edge; OCC keeps about 1e-15
# Distance, relative to coordinates and axes, up to which a formula is its curve: their round-off.
FORMULA_DISTANCE = 8 * np.finfo(float).eps
NEWTON_TOLERANCE = 1e-12  # relative change of a parameter from which the next is round-off


class CadEdge:
    """One CAD edge as a parametrised plane curve."""

    def __init__(self, edge: TopoDS_Shape) -> None:
        self._edge, self.name = edge, edge.name or ""  # of the boundary
        self.start, self.stop = edge.parameter_interval
        self._t = np.linspace(self.start, self.stop, SAMPLES)
        self._middle = (self.start + self.stop) / 2
        # Whether it is a straight segment with a constant derivative, or an arc of a circle.
        self.straight = self.circle = False
        self.samples = self.point(self._t)  # points (n, 2) along it
        self.size = float(np.abs(np.ptp(self.samples, axis=0)).max())  # its extent, a length
        first, last = self.samples[[0, -1]]
        chord = first + np.linspace(0, 1, SAMPLES)[:, None] * (last - first)
        self.straight = bool(np.abs(self.samples - chord).max() <= STRAIGHT * self.size)
        self.closed = bool(np.abs(last - first).max() <= LEVEL_DISTANCE * self.size)
        if not self.straight:  # of an arc, by the place and the slope in the middle
            x, [slope] = self.samples[SAMPLES // 2], self.derivative(self._t[[SAMPLES // 2]])
            radius = across(slope)
            radius *= np.sign(radius @ (x - first))  # outwards
            self._centre, self._axes, samples = x - radius, np.stack([radius, slope]), self.samples
            size = np.abs(samples).max() + np.abs(self._axes).max()
            self.circle = True
            self.circle = bool(
                np.abs(self.point(self._t) - samples).max() <= FORMULA_DISTANCE * size
            )

    def point(self, t: Array) -> Array:
        """Points (k, 2) at the parameters `t` (k,)."""
        if self.straight:  # without a call for every point
            share = (np.asarray(t) - self.start) / (self.stop - self.start)
            return self.samples[0] + share[:, None] * (self.samples[-1] - self.samples[0])
        if self.circle:
            s = np.asarray(t) - self._middle
            return self._centre + np.column_stack([np.cos(s), np.sin(s)]) @ self._axes
        values = (self._edge.Value(float(ti)) for ti in t)
        return np.array([(p.x, p.y) for p in values]).reshape(-1, 2)

    def derivative(self, t: Array) -> Array:
        """Derivatives (k, 2) with respect to the parameter, at `t` (k,)."""
        if self.straight:
            slope = (self.samples[[-1]] - self.samples[[0]]) / (self.stop - self.start)
            return slope.repeat(len(t), axis=0)
        if self.circle:
            s = np.asarray(t) - self._middle
            return np.column_stack([-np.sin(s), np.cos(s)]) @ self._axes
        values = (self._edge.Tangent(float(ti)) for ti in t)
        return np.array([(v.x, v.y) for v in values]).reshape(-1, 2)

    def _newton(self, t: Array, step: Callable[[Array, Index], Array]) -> Array:
        """Parameters (k,) after t - step(t), kept inside the interval, stands still."""
        rest = NEWTON_TOLERANCE * abs(self.stop - self.start)
        return newton(t, step, (self.start, self.stop), rest)

    def project(self, points: Array) -> Array:
        """Parameters (k,) of the closest points of the edge to `points` (k, 2) near it."""
        if self.straight:
            along = self.samples[-1] - self.samples[0]
            s = (points - self.samples[0]) @ along / (along @ along)
            return self.start + np.clip(s, 0, 1) * (self.stop - self.start)
        if self.circle:
            offset = points - self._centre
            s = np.arctan2(offset @ self._axes[1], offset @ self._axes[0])
            return np.minimum(np.maximum(self._middle + s, self.start), self.stop)
        nearest = ((points[:, None] - self.samples) ** 2).sum(axis=2).argmin(axis=1)

        def step(t: Array, at: Index) -> Array:
            tangent = self.derivative(t)
            return ((self.point(t) - points[at]) * tangent).sum(axis=1) / (tangent**2).sum(axis=1)

        t = self._newton(self._t[nearest], step)
        if self.closed and (at_seam := np.isin(nearest, (0, SAMPLES - 1))).any():
            # Newton's method does not cross the seam: the other end may be the right start.
            other = self._newton(np.where(at_seam, self._t[SAMPLES - 1 - nearest], t), step)
            miss, other_miss = (((self.point(s) - points) ** 2).sum(axis=1) for s in (t, other))
            t = np.where(other_miss < miss, other, t)
        return t

    def normal_at(self, t: Array) -> Array:
        """Unit normals (k, 2) at the parameters `t` (k,), right of the tangent."""
        return rightward(self.derivative(t))

    def level(self, axis: Array, values: Array, near: Array) -> Array:
        """Parameters (k,) where coordinates along `axis` (2,), or (k, 2), take `values` (k,).

        Of several such points the nearest one to the projections of the points `near` (k, 2), or
        the one that Newton's method reaches from there; NaN where there is none.
        """
        axes, t = np.broadcast_to(axis, near.shape), self.project(near)

        def step(t: Array, at: Index) -> Array:
            slope = (self.derivative(t) * axes[at]).sum(axis=1)
            off = (self.point(t) * axes[at]).sum(axis=1) - values[at]
            return off / np.where(slope == 0, np.inf, slope)

        if self.circle:  # the middle of the crossings, and half the angle between them
            cosine, sine = self._axes @ axes.T
            share = (values - axes @ self._centre) / np.hypot(cosine, sine)
            half = np.arccos(np.clip(share, -1, 1))
            ways = self._middle + np.arctan2(sine, cosine) - t + np.stack([-half, half])
            ways = (ways + np.pi) % (2 * np.pi) - np.pi
            t += np.where(np.abs(ways[0]) < np.abs(ways[1]), *ways)
            t = np.clip(t, self.start, self.stop)
        else:
            t = self._newton(t, step)
        missed = np.abs((self.point(t) * axes).sum(axis=1) - values) > LEVEL_DISTANCE * self.size
        return np.where(missed, np.nan, t)


@lru_cache(maxsize=1)  # for all meshes of one adaptive run
def _edges(geometry: OCCGeometry) -> list[CadEdge]:
    """Edges of a geometry; one between two faces occurs twice in the shape, here once."""
    return [CadEdge(edge) for edge in dict.fromkeys(geometry.shape.edges)]


def cad_edges(mesh: ng.Mesh) -> list[CadEdge] | None:
    """CAD edges by boundary region number, or None for solids and without an OCC geometry."""
    return None if mesh.dim != 2 else drawn_sides(mesh, _edges)


def drawn_sides(mesh: ng.Mesh, made: Callable[[OCCGeometry], list[Any]]) -> list[Any] | None:
    """What is `made` of a mesh's geometry, by boundary region; None without, or of other names."""
    geometry = mesh.ngmesh.GetGeometry()
    if not isinstance(geometry, OCCGeometry):
        return None
    sides, names = made(geometry), mesh.GetBoundaries()
    alike = [side.name or "default" for side in sides] == [name or "default" for name in names]
    return sides if alike else None


def same_geometry(one: OCCGeometry | ng.Mesh, other: OCCGeometry | ng.Mesh) -> bool:
    """Whether bodies, edges and their names are the same up to round-off; a mesh is only itself."""
    if one is other:
        return True
    if not (isinstance(one, OCCGeometry) and isinstance(other, OCCGeometry)):
        return False
    names = [[face.name for face in geometry.shape.faces] for geometry in (one, other)]
    edges, others = _edges(one), _edges(other)
    if names[0] != names[1] or [edge.name for edge in edges] != [edge.name for edge in others]:
        return False
    points, other_points = (np.array([edge.samples for edge in each]) for each in (edges, others))
    size = np.ptp(points.reshape(-1, 2), axis=0).max()
    return bool(np.abs(points - other_points).max() <= LEVEL_DISTANCE * size)
