"""Narrow features of data: places where functions depart from what is around them.

Every function is looked at once per run, at samples that no mesh decides: a strip of a thousandth
of a boundary holds one, and so does a box of 6e-3 of a body's extent. The opening of a function,
the largest of its least values in a window, has lost each peak that is narrower than the window,
the closing each valley; steps and slopes stay. The next window, of twice the width, loses no more
of a feature, but twice as much of a kink and four times as much of a smooth extremum.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np
from scipy.ndimage import (
    distance_transform_edt,
    label,
    maximum,
    maximum_filter1d,
    minimum_filter1d,
    uniform_filter,
)
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask
from ..problem import Problem, varies
from .cells import Cells, joined
from .constant_data import numbers
from .lattice import GOLDEN
from .view import View

ON_LINE = 2048  # samples of a boundary: none are further apart than 1 / 1365 of it
IN_BODY = 5.2e-3  # between samples of a body, over its extent: discs of radius 3e-3 hold one
TURN = 0.3  # angle of their lattice, out of step with edges
WINDOWS = (3, 7, 15, 31, 63, 127, 255)  # samples, each of twice the last and one
STEEP = 0.5  # of the change in a window, what is lost there of a feature
AT_ENDS = 31  # of these, for features at ends of lines, where the end of a wave looks like one ...
HIGH = 0.05  # ... of less than this share of the range
# The same in bodies; laws are not integrated on parts of elements that follow them.
IN_PLANE = {"force": (5, 11), "materials": (5, 11, 23, 47)}
BESIDE = 4  # samples, half of them on each side
SATURATED = 1.5  # times what a window loses, from which the next one loses more than a feature
# Departures that count: of loads relative to their mean size, of laws in their logarithm, of
# displacements and gaps relative to their range.
SHARE = {"traction": 0.1, "force": 0.1, "materials": 0.1, "displacement": 1e-5, "gap": 1e-5}
ROUND_OFF = 1e-10  # of values, relative to the largest
FEW = 6  # samples in a feature up to which what is between them is looked at
MEASURED = 65  # points across a feature, to tell its width
FEATURES = 200  # of one function on a line, or that are measured in a body
NARROWEST = 0.1  # samples: no feature is taken for narrower

Function: TypeAlias = ng.CoefficientFunction | Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Features:
    """Narrow features of a function on a boundary, or in a body.

    Attributes
    ----------
    kind, name : str
        What the function is, as "gap", and where.
    dim : int
        1 on boundaries, 2 in bodies.
    places : ndarray (k, 2)
        Lengths.
    widths : ndarray (k,)
        Lengths.
    samples : int
        At which it was looked at.
    vanishes : bool
        Whether it is 0 at all of them.
    """

    kind: str
    name: str
    dim: int
    places: Array
    widths: Array
    samples: int
    vanishes: bool


# By the object that holds a function, which lives as long as the problem; by kind and name.
FOUND: WeakKeyDictionary[Any, dict[tuple[str, str], Features]] = WeakKeyDictionary()


def _functions(
    problem: Problem, mesh: ng.Mesh
) -> Iterator[tuple[str, str, object, Function, ng.Region]]:
    """Kind, name, owner, function and region of all data that are no numbers."""
    for name, F in problem.force.items():
        if not numbers(F):
            yield "force", name, F, F, mesh.Materials(name)
    for name, p in problem.traction.items():
        if not numbers(p):
            yield "traction", name, p, p, mesh.Boundaries(name)
    for name, components in problem.displacement.items():
        for value in components:
            if value is not None and not numbers(value):
                yield "displacement", name, value, value, mesh.Boundaries(name)
    for pair in problem.contact:
        if pair.gap is not None and not isinstance(pair.gap, float):
            yield "gap", pair.secondary, pair, pair.gap, mesh.Boundaries(pair.secondary)
    for name, law in problem.materials.items():
        if varies(law):
            C = law.voigt(problem.model)
            yield "materials", name, law, C, mesh.Materials(name)


def look(problem: Problem, mesh: ng.Mesh) -> None:
    """Look at all functions of a problem anew: `features_of` knows them from now on."""
    for kind, name, owner, function, region in _functions(problem, mesh):
        FOUND.setdefault(owner, {})[kind, name] = _looked_at(kind, name, function, region)


def features_of(problem: Problem, mesh: ng.Mesh) -> list[Features]:
    """What `look` found of the functions of a problem last; a look where there was none."""
    found = []
    for kind, name, owner, function, region in _functions(problem, mesh):
        known = FOUND.setdefault(owner, {})
        if (kind, name) not in known:
            known[kind, name] = _looked_at(kind, name, function, region)
        found.append(known[kind, name])
    return found


def features_in(load: object) -> Array:
    """Places and widths (k, 3) that `look` found of a load, on all boundaries or in all bodies."""
    found = FOUND.get(load, {}).values()
    rows = [np.column_stack([one.places, one.widths]) for one in found]
    return np.concatenate([np.empty((0, 3)), *rows])


def _looked_at(kind: str, name: str, function: Function, region: ng.Region) -> Features:
    dim = 2 if region.VB() == ng.VOL else 1
    places, widths, count, any_value = [np.empty((0, 2))], [np.empty(0)], 0, False
    if isinstance(function, ng.CoefficientFunction) and numbers(function):
        return Features(kind, name, dim, places[0], widths[0], 0, vanishes=False)
    view = View(region.mesh, dim)
    look = _in_body if dim == 2 else _on_line
    for elements in _parts(view, region):
        x, w, n, vanishes = look(kind, function, view, elements)
        places.append(x)
        widths.append(w)
        count, any_value = count + n, any_value or not vanishes
    x, w = np.concatenate(places), np.concatenate(widths)
    return Features(kind, name, dim, x, w, count, vanishes=not any_value)


def _parts(view: View, region: ng.Region) -> list[Index]:
    """The elements of a region by the names of its boundaries or bodies."""
    mesh, arrays = view.mesh, view.arrays
    number = arrays.bodies if view.dim == 2 else arrays.boundaries
    names = mesh.GetMaterials() if view.dim == 2 else mesh.GetBoundaries()
    inside: dict[str, list[int]] = defaultdict(list)
    for k in np.flatnonzero(np.array(region.Mask())).tolist():
        inside[names[k]].append(k)
    found = [np.flatnonzero(np.isin(number, some)) for some in inside.values()]
    return [elements for elements in found if elements.size]


def _values(function: Function, view: View, elements: Index, reference: Array) -> Array:
    """Values (n, c) at a point `reference` (n, dim) of each of `elements` (n,), 0 if infinite."""
    if isinstance(function, ng.CoefficientFunction):
        values = view.look(function, elements, reference[:, None])[:, 0]
    else:
        x, y = _positions(view, elements, reference).T
        values = np.asarray(function(x, y), dtype=float)[:, None]
    return np.where(np.isfinite(values), values, 0.0)


def _positions(view: View, elements: Index, reference: Array) -> Array:
    return view.evaluate(ng.CF((ng.x, ng.y)), elements, reference[:, None])[:, 0]


def _told(kind: str, values: Array) -> tuple[Array, float]:
    """What is looked at of `values` (n, c), (n, c'), and what counts as a departure."""
    if kind == "materials":
        diagonal = values[:, :: round(values.shape[1] ** 0.5) + 1]
        stiffness = np.log(np.maximum(np.abs(diagonal), np.finfo(float).tiny))
        return stiffness.mean(axis=1, keepdims=True), SHARE[kind]
    size = float(np.abs(values).max(initial=0.0))
    unit = float(np.abs(values).max(axis=1).mean()) if kind in ("traction", "force") else 0.0
    unit = unit or float(np.ptp(values, axis=0).max(initial=0.0))
    return values, max(SHARE[kind] * unit, ROUND_OFF * size)


def _lost(values: Array, window: int, inside: Mask | None = None) -> Array:
    """What the opening of `values` in a window of so many samples has lost: of peaks.

    Along all axes. On a line windows do not reach beyond its ends; in a plane they do not beyond
    the samples `inside`, and nothing is lost beside values that are kept, as windows do not fit
    into convex corners.
    """
    least, again = values, window if inside is None else window + BESIDE
    if inside is not None:
        least = np.where(inside, least, np.inf)
    for axis in range(values.ndim):
        least = minimum_filter1d(least, window, axis)
    if inside is None:
        least[: window // 2] = least[-(window // 2) :] = -np.inf
    else:
        least = np.where(inside, least, -np.inf)
    for axis in range(values.ndim):
        least = maximum_filter1d(least, again, axis)
    return np.asarray(values - least)


def _on_line(
    kind: str, function: Function, view: View, segments: Index
) -> tuple[Array, Array, int, bool]:
    """Places (k, 2) and widths (k,) of features; the number of samples, and whether all are 0."""
    chains = _chains(view, segments)
    whole = view.sizes[segments].sum()
    places, widths, count, vanishes = [np.empty((0, 2))], [np.empty(0)], 0, True
    looked = []
    for at, turned in chains:
        ends = np.append(0.0, np.cumsum(view.sizes[at]))
        n = max(round(ON_LINE * ends[-1] / whole), len(at), WINDOWS[0])
        t = (np.arange(n) + 0.25 + 0.5 * (GOLDEN * np.arange(n) % 1)) / n * ends[-1]
        looked.append((at, turned, ends, t, _values(function, view, *_on(at, turned, ends, t))))
    _, limit = _told(kind, np.concatenate([one[-1] for one in looked]))
    for at, turned, ends, t, values in looked:
        count, vanishes = count + len(t), vanishes and not values.any()
        for component in np.hstack([values, -values]).T:
            departure = _departures(component, limit)
            runs = _runs(departure > 0)
            if len(runs) > FEATURES:  # no features but roughness, which the estimate tells
                continue
            for first, last in runs:
                low = t[first - 1] if first else 0.0
                high = t[last] if last < len(t) else ends[-1]
                if last - first < FEW:  # what is between samples counts
                    fine = low + (high - low) * (np.arange(MEASURED) + 0.5) / MEASURED
                    found = _values(function, view, *_on(at, turned, ends, fine))
                    # Both ends are beside the feature, unless the line ends there.
                    base = found[[0 if first else -1, -1 if last < len(t) else 0]].mean(axis=0)
                    away = np.abs(found - base).max(axis=1)
                else:
                    fine, away = t[first:last], departure[first:last]
                most = away > away.max() / 2
                width = np.count_nonzero(most) / len(most) * (high - low)
                widths.append(np.array([max(width, NARROWEST * whole / ON_LINE)]))
                middle = np.median(fine[most]) if most.any() else (low + high) / 2
                places.append(_positions(view, *_on(at, turned, ends, np.array([middle]))))
    return np.concatenate(places), np.concatenate(widths), count, vanishes


def _runs(some: Mask) -> list[list[int]]:
    """Where each run of `some` (n,) begins, and where the rest begins again."""
    changes = np.diff(np.concatenate([[0], some.astype(int), [0]]))
    return np.flatnonzero(changes).reshape(-1, 2).tolist()


def _departures(values: Array, limit: float) -> Array:
    """By how much each of `values` (n,) departs in a peak, by more than a limit, (n,); else 0."""
    found = np.zeros(len(values))
    windows = [window for window in WINDOWS if window <= len(values) / 2]
    lost = [_lost(values, window) for window in windows]
    for window, (now, then) in zip(windows, pairwise(lost), strict=False):
        some = (now > limit) & (then < SATURATED * now)
        around = maximum_filter1d(values, window) - minimum_filter1d(values, window)
        some &= now > STEEP * around
        for end in (slice(window // 2), slice(-(window // 2), None)):
            some[end] &= window <= AT_ENDS and now[end] > HIGH * np.ptp(values)
        found = np.maximum(found, np.where(some, now, 0.0))
    return found


def _on(at: Index, turned: Mask, ends: Array, t: Array) -> tuple[Index, Array]:
    """Segments and points on them at the lengths `t` (n,) of a chain of segments `at`."""
    k = np.clip(np.searchsorted(ends, t, side="right") - 1, 0, len(at) - 1)
    s = np.clip((t - ends[k]) / (ends[k + 1] - ends[k]), 0.0, 1.0)
    return at[k], np.where(turned[k], 1 - s, s)[:, None]


def _chains(view: View, segments: Index) -> list[tuple[Index, Mask]]:
    """The `segments` (k,) one after the other, as chains, and whether each is run backwards."""
    ends = view.arrays.segments[segments, ::-1].tolist()  # as NGSolve's parameter runs
    at: dict[int, list[int]] = defaultdict(list)
    for k, pair in enumerate(ends):
        for vertex in pair:
            at[vertex].append(k)
    left, chains = set(range(len(ends))), []
    for vertex in sorted(at, key=lambda v: len(at[v]) == 2):  # ends of lines first, then circles
        chain, turned = [], []
        while following := [k for k in at[vertex] if k in left]:
            k = following[0]
            left.remove(k)
            chain.append(k)
            turned.append(ends[k][0] != vertex)
            vertex = ends[k][0] if turned[-1] else ends[k][1]
        if chain:
            chains.append((segments[np.array(chain)], np.array(turned)))
    return chains


def _in_body(
    kind: str, function: Function, view: View, elements: Index
) -> tuple[Array, Array, int, bool]:
    """The same of triangles, as of `_on_line`."""
    corners = view.arrays.corners[elements]
    spacing = IN_BODY * float(np.ptp(corners.reshape(-1, 2), axis=0).max())
    c, s = np.cos([TURN, TURN + np.pi / 3]), np.sin([TURN, TURN + np.pi / 3])
    sides = spacing * np.column_stack([c, s])  # of the lattice's cells, as rows
    corners = corners @ np.linalg.inv(sides)
    origin = np.floor(corners.min(axis=(0, 1)))
    corners -= origin
    shape = tuple(np.ceil(corners.max(axis=(0, 1))).astype(int) + 1)
    element, i, j = _nodes_in(corners)
    inverse = np.linalg.inv(corners[:, :2] - corners[:, 2:])
    reference = np.column_stack([i, j]) - corners[element, 2]
    reference = (reference[:, None] @ inverse[element])[:, 0]
    values = _values(function, view, elements[element], reference)
    vanishes, (told, limit) = not values.any(), _told(kind, values)
    inside = np.zeros(shape, dtype=bool)
    inside[i, j] = True
    flagged, windows = np.zeros(shape, dtype=bool), IN_PLANE[kind]
    wide = windows[-1]
    for component in told.T:
        array = np.full(shape, np.nan)
        array[i, j] = component
        some = np.zeros(shape, dtype=bool)  # a feature is left within half of the smaller window
        for axis in (0, 1):
            step = np.abs(np.diff(array, axis=axis, append=np.nan)) > limit / windows[0]
            some |= step
        if not some.any():
            continue
        part = tuple(slice(max(k.min() - wide, 0), k.max() + wide + 2) for k in np.nonzero(some))
        here = inside[part]
        lost = [
            np.where(here, np.maximum(*(_lost(x, w, here) for x in (array[part], -array[part]))), 0)
            for w in windows
        ]
        # Around convex corners of a part more is lost in the wide window, if not at a sample.
        for window, (now, then) in zip(windows[1:], pairwise(lost), strict=True):
            around = [uniform_filter(x, 2 * window + 1, mode="constant") for x in (now, then)]
            flagged[part] |= (now > limit) & (around[1] < SATURATED * around[0])
    x = (np.argwhere(flagged) + origin) @ sides
    parts, _ = label(flagged, np.ones((3, 3)))
    depth = distance_transform_edt(np.pad(flagged, 1))[1:-1, 1:-1]  # samples, 1 at the rim
    depth = np.append(0.0, maximum(depth, parts, np.arange(1, parts.max() + 1)))[parts[flagged]]
    widths = spacing * (2 * depth - 1)
    if kind == "materials" and len(x):
        widths = _widths(function, view.mesh, x, spacing)
    return x, widths, len(values), vanishes


def _nodes_in(corners: Array) -> tuple[Index, Index, Index]:
    """Triangle, and both numbers (n,), of each node (i, j) of a lattice in triangles (k, 3, 2)."""
    y = corners[..., 1]
    low, high = np.ceil(y.min(axis=1)).astype(int), np.floor(y.max(axis=1)).astype(int)
    count = np.maximum(high - low + 1, 0)
    of = np.repeat(np.arange(len(corners)), count)
    row = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + low[of]
    a, b = corners[of], np.roll(corners, -1, axis=1)[of]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (row[:, None] - a[..., 1]) / (b[..., 1] - a[..., 1])
        crossing = a[..., 0] + share * (b[..., 0] - a[..., 0])
    met = (share >= 0) & (share <= 1)
    first = np.ceil(np.where(met, crossing, np.inf).min(axis=1))
    last = np.floor(np.where(met, crossing, -np.inf).max(axis=1))
    some = last >= first
    of, row, first = of[some], row[some], first[some].astype(int)
    count = last[some].astype(int) - first + 1
    k = np.repeat(np.arange(len(of)), count)
    i = np.arange(len(k)) - np.repeat(np.cumsum(count) - count, count) + first[k]
    return of[k], i, row[k]


def _widths(law: ng.CoefficientFunction, mesh: ng.Mesh, places: Array, spacing: float) -> Array:
    """Widths (k,) of features at `places` (k, 2): the least in four directions."""
    some = np.linspace(0, len(places) - 1, min(len(places), FEATURES // 2)).astype(int)
    t = np.linspace(-2 * spacing, 2 * spacing, MEASURED)
    angle = TURN / 2 + np.pi / 4 * np.arange(4)
    steps = t[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    x = (places[some][:, None, None] + steps).reshape(-1, 2)
    points = mesh(x[:, 0].copy(), x[:, 1].copy())
    known = points["nr"] >= 0
    told = np.zeros(len(x))
    told[known] = _told("materials", np.asarray(law(points[known])))[0][:, 0]
    shape, middle = (len(some), MEASURED, 4), MEASURED // 2
    table = told.reshape(shape)
    away = np.abs(table - table[:, middle : middle + 1])
    away[~known.reshape(shape)] = 0.0
    same = away <= away.max(axis=1, keepdims=True) / 2
    up = np.cumprod(same[:, middle:], axis=1).sum(axis=1)
    down = np.cumprod(same[:, middle::-1], axis=1).sum(axis=1)
    width = ((up + down - 1) * (t[1] - t[0])).min(axis=1)
    result = np.full(len(places), width.min())
    result[some] = width
    return np.maximum(result, NARROWEST * spacing)


def towards(features: Array, cells: Cells, view: View) -> Cells:
    """The `cells`, halved at `features` (k, 3), places and widths, to the size of these."""
    done, tree = [], cKDTree(features[:, :2])
    middle = np.full((1, 1, view.dim), 1 / (view.dim + 1))
    while len(cells.element):
        at = cells.origin[:, None] + middle @ cells.side
        x = _positions(view, cells.element, at[:, 0])
        size = view.sizes[cells.element] * np.abs(cells.side).sum(axis=2).max(axis=1)
        distance, nearest = tree.query(x)
        width = features[nearest, 2]
        near = (distance <= size + width) & (size > width)
        done.append(cells[~near])
        cells = cells[near].divided(2)
    return joined(done)


def touched(features: Array, view: View, elements: Index) -> tuple[Index, Index]:
    """Elements (j,) of `elements` (k,) and features (j,) of `features` (n, 3) that meet.

    Features reach their width; in bodies the nearest stands for all.
    """
    if not len(features):
        return elements[:0], elements[:0]
    middle = np.full((len(elements), view.dim), 1 / (view.dim + 1))
    x, size = _positions(view, elements, middle), view.sizes[elements]
    if view.dim == 2:
        distance, nearest = cKDTree(features[:, :2]).query(x)
        some = distance <= 0.6 * size + features[nearest, 2]
        return elements[some], nearest[some]
    distance = np.linalg.norm(x[:, None] - features[:, :2], axis=2)
    k, feature = np.nonzero(distance <= 0.5 * size[:, None] + features[:, 2])
    return elements[k], feature
