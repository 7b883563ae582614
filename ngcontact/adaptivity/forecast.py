"""What indicators become when elements are bisected, told before there is another solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..problem import Problem, Triangulation
from .exceptions import at_limit, settled
from .marking import doerfler
from .refinement import Refining
from .singularities import Singularities

BESIDE = 0.1  # barycentric coordinate: a point so far outside of an element still touches it
MARKINGS = 8  # most that one estimate is good for


def areas(corners: Array) -> Array:
    """Areas (k,) of triangles with the `corners` (k, 3, 2)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2


def depths(corners: Array, places: Array) -> Array:
    """Least barycentric coordinate of points in triangles, negative outside.

    Parameters
    ----------
    corners : ndarray (n, 3, 2) or (n, 1, 3, 2)
        Lengths.
    places : ndarray (n, 2) or (k, 2)

    Returns
    -------
    ndarray (n,) or (n, k)
    """
    origin = corners[..., 0, :]
    first, second, to = corners[..., 1, :] - origin, corners[..., 2, :] - origin, places - origin
    whole = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    along = (to[..., 0] * second[..., 1] - to[..., 1] * second[..., 0]) / whole
    across = (first[..., 0] * to[..., 1] - first[..., 1] * to[..., 0]) / whole
    return np.asarray(np.minimum(np.minimum(along, across), 1 - along - across))


def touching(corners: Array, places: Array) -> Mask:
    """Whether triangles with `corners` (n, 3, 2) touch points `places` (k, 2), (n, k)."""
    return depths(corners[:, None], places) >= -BESIDE


@dataclass(frozen=True, eq=False)
class Forecast:
    """Squared indicators of a mesh that has not been solved on.

    On an element of area a on which the solution is smooth, eta_T^2 ~ a^(p+1): the square of
    |D^(p+1) u| times h^(2p) times the area. On one that touches a singular point it falls by that
    point's power of the area. Parts of an element share its square by that.

    Attributes
    ----------
    corners : ndarray (ne, 3, 2)
        Of the elements, lengths.
    squares : ndarray (ne,)
        Squared indicators, in shares of the sum of those that were estimated.
    order : int
        Degree p of the displacement.
    singular : Singularities
        Where it is not smooth.
    """

    corners: Array
    squares: Array
    order: int
    singular: Singularities

    @property
    def error(self) -> float:
        """The error, over the one that was estimated."""
        return float(np.sqrt(self.squares.sum()))

    def after(self, corners: Array, parent: Index) -> Forecast:
        """On elements with `corners` (k, 3, 2), each of them a part of a `parent` (k,)."""
        area = areas(corners)
        share = np.minimum(area / areas(self.corners)[parent], 1.0)
        power = np.full(len(parent), self.order + 1.0)
        new = np.flatnonzero(share < 1)
        at = touching(corners[new], self.singular.places)
        powers = np.where(at, self.singular.powers, np.inf).min(axis=1, initial=np.inf)
        power[new] = np.minimum(powers, self.order + 1)
        squares = self.squares[parent] * share**power
        return replace(self, corners=corners, squares=squares)

    def marked(self, theta: float, share: float) -> Mask:
        """Elements (ne,) to refine: Doerfler's, and those in which contact ends.

        Of these the ones larger than the `share` of their contact line, as by `at_ends`.
        """
        marked = doerfler(np.sqrt(self.squares), theta)
        ends = np.isfinite(self.singular.extents)
        sizes = np.sqrt(2 * areas(self.corners))  # the legs, if two are equal at a right angle
        large = np.flatnonzero(sizes > share * self.singular.extents[ends].min(initial=np.inf))
        at = touching(self.corners[large], self.singular.places[ends])
        limits = share * self.singular.extents[ends]
        marked[large] |= (at & (sizes[large, None] > limits)).any(axis=1)
        return marked


@dataclass(frozen=True)
class Aim:
    """How far a level is planned: until it has so many `unknowns`, or so small an error.

    Attributes
    ----------
    unknowns : float
        From which it is enough.
    most : float
        That it must not exceed.
    error : float
        Over the one that was estimated, from which it is enough.
    theta, ending : float
        Doerfler's share, and the size of elements at ends of contact over their line per error.
    markings : float
        Most that the forecast is good for.
    """

    unknowns: float
    most: float
    error: float
    theta: float
    ending: float
    markings: float = MARKINGS


def planned(
    problem: Problem,
    mesh: ng.Mesh,
    marked: Mask,
    forecast: Forecast,
    aim: Aim,
    element: str,
) -> tuple[ng.Mesh, float, Index]:
    """The next level's mesh, straight-sided, the error that is forecast on it, and parents (k,).

    These are the elements of `mesh` of which its own are parts. The elements `marked` (ne,) are
    refined, then again and again those that the forecast marks. Elements at unresolvable corners
    count no more once they are small, as in `settled`.
    """
    refining, marks, forecasts = Refining(problem, mesh), [marked], [forecast]
    while True:
        parent = refining.bisect(marks[-1])
        forecast = forecasts[-1].after(Triangulation(refining.mesh).corners, parent)
        small = settled(refining.mesh, forecast.singular.unresolvable)
        forecasts.append(replace(forecast, squares=np.where(small, 0.0, forecast.squares)))
        unknowns, error = refining.unknowns(forecast.order, element), forecasts[-1].error
        if unknowns > aim.most and len(marks) > 1:  # one too many: again without it
            refining = Refining(problem, mesh)
            for again in marks[:-1]:
                refining.bisect(again)
            return refining.finished(), forecasts[-2].error, refining.origin
        if unknowns >= aim.unknowns or error <= aim.error or len(marks) >= aim.markings:
            return refining.finished(), error, refining.origin
        limit = at_limit(refining.mesh, mesh.GetCurveOrder())
        marks.append(forecasts[-1].marked(aim.theta, aim.ending * error) & ~limit)
        if not marks[-1].any():
            return refining.finished(), error, refining.origin
