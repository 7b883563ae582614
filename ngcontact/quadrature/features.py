"""Narrow features of data, where functions depart from what is around them, and jumps on lines.

Every function is looked at once per run, at samples that no mesh decides: a strip of a thousandth
of a boundary holds one, and so does a box of 6e-3 of a body's extent. The opening of a function,
the largest of its least values in a window, has lost each peak that is narrower than the window,
the closing each valley; steps and slopes stay. The next window, of twice the width, loses no more
of a feature, but twice as much of a kink and four times as much of a smooth extremum.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, joined, rows_of
from ..mesh import curve
from ..problem import POSITION, Problem, numbers, varies
from .cells import ElementParts, SampledElements, lattice, sampled

ROUND_ORDER = 12  # of a mesh without kinks: 1e-13 of the radius off circles of 13 segments
LINE_SAMPLES = 2048  # samples of a boundary: none are further apart than 1 / 1365 of it
BODY_SPACING = 5.2e-3  # between samples of a body, over its extent: discs of radius 3e-3 hold one
LATTICE_ANGLE = 0.3  # angle of their lattice, out of step with edges
WINDOWS = (3, 7, 15, 31, 63, 127, 255)  # samples, each of twice the last and one
WINDOW_LOSS = 0.5  # of the change in a window, what is lost there of a feature
# Of these, for features at ends of lines, where the end of a wave looks like one ...
END_WINDOW = 31
END_WINDOWS = 6  # ... but goes on as a polynomial through so many windows,
END_DEGREE = 3  # of such a degree
# The same in bodies; laws are not integrated on parts of elements that follow them.
IN_PLANE = {"force": (5, 11), "materials": (5, 11, 23, 47), "strain": (5, 11, 23, 47)}
WINDOW_SAMPLES = 4  # samples, half of them on each side
LOSS_GROWTH = 1.5  # times what a window loses, from which the next one loses more than a feature
# Departures that count: of loads and strains relative to their mean size, of laws in their
# logarithm, of displacements and gaps relative to their range.
FEATURE_SHARES = {
    "traction": 0.1,
    "force": 0.1,
    "materials": 0.1,
    "displacement": 1e-5,
    "gap": 1e-5,
    "strain": 0.1,
}
VALUE_ROUND_OFF = 1e-10  # of values, relative to the largest
NARROW_SAMPLES = 6  # samples in a feature up to which what is between them is looked at
WIDTH_POINTS = 65  # points across a feature, to measure its width
FEATURES = 200  # of one function on a line
MEASURED_FEATURES = 16  # features of a body of which widths are measured ...
MAX_HALF_WIDTH = 8.0  # ... up to so many samples on either side ...
CHORD_POINTS = 20  # ... by so many points: to a quarter
MIN_WIDTH = 0.1  # samples: no feature is taken for narrower
QUARTERS = np.linspace(0, 1, 5)
QUARTERINGS = 18  # in which a part is quartered: what still changes across 1e-11 of it jumps
KEPT_CHANGE = 0.9  # what the last half of the steps leave of a jump; of x^(1/10) they leave 0.3
STEADY_CHANGE = 1e-9  # change across a part, relative to the largest value, that is not looked into
# Size of an element over the width of a feature in it, up to which it is resolved. Loads are
# integrated on parts of elements, but stresses in equilibrium meet body forces on so many of them.
RESOLVED_WIDTHS = {"displacement": 2.0, "gap": 2.0, "materials": 2.0, "strain": 2.0}
BOUND_WIDTHS = RESOLVED_WIDTHS | {"force": 32.0, "traction": 2.0}  # the last one on curves
CHORD_DISTANCE = 1e-9  # of a segment, its distance from a chord

Function: TypeAlias = ng.CoefficientFunction | Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Features:
    """Narrow features of a function on a boundary, or in a body, and its jumps."""

    kind: str  # what the function is, as "gap"
    name: str  # and where
    axis: int  # of displacements, their component
    dim: int  # 1 on boundaries, 2 in bodies
    spots: Array  # (k, 3), places and widths, lengths
    jumps: Array  # (j, 3) of displacements: a place, and by how much; lengths
    samples: int  # at which it was looked at
    largest: float  # size of a value there


NO_JUMPS = np.empty((0, 3))
LOADS = ("force", "traction", "strain")


class Datum(NamedTuple):
    """A function among the data, or a law; the owner is the object that lives with the problem."""

    kind: str
    name: str
    axis: int
    owner: Any
    function: Any


# By the owner of a function; by kind, name and axis.
FOUND: WeakKeyDictionary[Any, dict[Any, Features]] = WeakKeyDictionary()


def _functions(problem: Problem) -> Iterator[Datum]:
    """All data that are no numbers; of solids none are looked at."""
    if problem.dim == 3:
        return
    data = [
        Datum(kind, name, 0, f, f) for kind in LOADS for name, f in getattr(problem, kind).items()
    ]
    for name, components in problem.displacement.items():
        data += [Datum("displacement", name, axis, u, u) for axis, u in enumerate(components)]
    data += [Datum("gap", pair.secondary, 0, pair, pair.gap) for pair in problem.contact]
    for datum in data:
        f = datum.function
        if callable(f) and not (isinstance(f, ng.CoefficientFunction) and numbers(f)):
            yield datum
    for name, law in problem.materials.items():
        if varies(law):
            yield Datum("materials", name, 0, law, law)


def features_of(problem: Problem, mesh: ng.Mesh, *, again: bool = False) -> list[Features]:
    """Features of all functions of a problem, of their last sampling unless looked at `again`."""
    found = []
    for datum in _functions(problem):
        known = FOUND.setdefault(datum.owner, {})
        if again or datum[:3] not in known:
            known[datum[:3]] = _sampled_features(problem, mesh, datum)
        found.append(known[datum[:3]])
    return found


def features_in(load: object) -> Array:
    """Places and widths (k, 3) that were found of a load, on all boundaries or in all bodies."""
    return np.concatenate([NO_JUMPS, *(one.spots for one in FOUND.get(load, {}).values())])


def _sampled_features(problem: Problem, mesh: ng.Mesh, datum: Datum) -> Features:
    kind, name, function = datum.kind, datum.name, datum.function
    view = SampledElements(mesh, 2 if kind in IN_PLANE else 1)
    inside = view.inside(mesh.Materials(name) if view.dim == 2 else mesh.Boundaries(name))
    if kind == "materials":  # the diagonal of the law; compiled, as a modulus stands in each entry
        C = function.voigt(problem.model)
        function = ng.CF(tuple(C[k, k] for k in range(C.dims[0]))).Compile()
    spots, jumps, samples, largest = [NO_JUMPS], [NO_JUMPS], 0, 0.0
    names = view.names[inside]
    for part in dict.fromkeys(names.tolist()):  # regions of one name are one part
        elements = inside[names == part]
        if view.dim == 2:
            found, values = _in_body(kind, function, view, elements)
        else:
            spacing = float(view.sizes[elements].sum() / LINE_SAMPLES)
            chains = _chains(view, elements)
            lines = [_Line(function, view, *chain, spacing) for chain in chains]
            found, values, limit = _on_lines(kind, lines)
            if len(found):  # on a polygon or a curved mesh a function of places has its kinks, too
                rounder = SampledElements(curve(mesh, ROUND_ORDER, "isoparametric")[0], 1)
                again = [replace(line, view=rounder) for line in lines]
                found = min(found, _on_lines(kind, again, limit)[0], key=len)
            jumps += [line.jumps() for line in lines if kind == "displacement"]
        spots.append(found)
        samples, largest = samples + len(values), max(largest, float(np.abs(values).max(initial=0)))
    every, jumping = np.concatenate(spots), np.concatenate(jumps)
    return Features(kind, name, datum.axis, view.dim, every, jumping, samples, largest)


def _values(function: Function, points: NDArray) -> Array:
    """Values (n, c) at NGSolve's `points` (n,), 0 where infinite."""
    if isinstance(function, ng.CoefficientFunction):
        values = sampled(function, points)
    else:
        x, y, _ = POSITION(points).T.copy()
        values = np.asarray(function(x, y), dtype=float)[:, None]
    return np.where(np.isfinite(values), values, 0.0)


def _searched(kind: str, values: Array) -> tuple[Array, float]:
    """Components (n, c') of `values` (n, c) that are searched, and the least departure."""
    if kind == "materials":
        stiffness = np.log(np.maximum(np.abs(values), np.finfo(float).tiny))
        return stiffness.mean(axis=1, keepdims=True), FEATURE_SHARES[kind]
    size = float(np.abs(values).max(initial=0.0))
    unit = float(np.abs(values).max(axis=1).mean()) if kind in LOADS else 0.0
    unit = unit or float(np.ptp(values, axis=0).max(initial=0.0))
    return values, max(FEATURE_SHARES[kind] * unit, VALUE_ROUND_OFF * size)


def _lost(values: Array, window: int, inside: Mask | None = None) -> Array:
    """Height of peaks that the opening of `values`, in a window of so many samples, lost.

    Along a line it is the last axis, of several components, and windows do not reach beyond its
    ends; in a plane all axes, and they do not reach beyond the samples `inside`, and nothing is
    lost beside values that are kept, as windows do not fit into convex corners.
    """
    if inside is None:
        ends = np.full((len(values), window - 1), -np.inf)
        least = np.hstack([ends, _extremes(np.minimum, values, window), ends])
        return np.asarray(values - _extremes(np.maximum, least, window))
    least = np.where(inside, values, np.inf)
    for axis in range(values.ndim):
        least = minimum_filter1d(least, window, axis)
    least = np.where(inside, least, -np.inf)
    for axis in range(values.ndim):
        least = maximum_filter1d(least, window + WINDOW_SAMPLES, axis)
    return np.asarray(values - least)


def _extremes(extreme: np.ufunc, values: Array, window: int) -> Array:
    """Extremes (c, n - window + 1) of `values` (c, n) in all windows, of 2^k - 1 samples each."""
    found, half = values, 1  # by those of half the size: few calls, of which SciPy's have many
    while half < window:
        sides = extreme(found[:, : -half - 1], found[:, half + 1 :])
        found, half = extreme(sides, values[:, half:-half]), 2 * half + 1
    return found


@dataclass(frozen=True, eq=False)
class _Line:
    """A function along a chain of segments, some of which are run backwards."""

    function: Function
    view: SampledElements
    segments: Index
    turned: Mask
    spacing: float  # of samples, a length

    @cached_property
    def t(self) -> Array:
        """Lengths (n,) from the start to the samples."""
        n = round(self.ends[-1] / self.spacing)
        return self.ends[-1] * lattice(1, max(n, len(self.segments), WINDOWS[0]))[:, 0]

    @cached_property
    def sampled(self) -> Array:
        """Values (n, c) at the samples."""
        return self.values(self.t)

    @cached_property
    def ends(self) -> Array:
        """Lengths from the start to all ends of segments."""
        return np.append(0.0, np.cumsum(self.view.sizes[self.segments]))

    @property
    def closed(self) -> bool:
        """Whether it ends where it starts."""
        return bool(np.ptp(self.places(self.ends[[0, -1]]), axis=0).max() < self.spacing / 2)

    def _at(self, t: Array) -> tuple[Index, Array]:
        """Segments and points on them at the lengths `t` (n,)."""
        k = np.searchsorted(self.ends, t, side="right") - 1
        k = np.clip(k, 0, len(self.segments) - 1)
        s = np.clip((t - self.ends[k]) / np.diff(self.ends)[k], 0.0, 1.0)
        return self.segments[k], np.where(self.turned[k], 1 - s, s)[:, None]

    def values(self, t: Array) -> Array:
        """Values (n, c) of the function at the lengths `t` (n,)."""
        segments, s = self._at(t)
        return _values(self.function, self.view.points(segments, s[:, None])[:, 0])

    def places(self, t: Array) -> Array:
        """Points (n, 2) at the lengths `t` (n,)."""
        return self.view.positions(*self._at(t))

    def jumps(self) -> Array:
        """Places and sizes (j, 3) of jumps of a scalar between its samples, at ends, too."""
        t = np.concatenate([[0.0], self.t, self.ends[-1:]])
        first, last = self.values(t[[0, -1]])
        known = np.concatenate([first, self.sampled[:, 0], last])
        at, size = steps_along(lambda t: self.values(t)[:, 0], t, known)
        return np.column_stack([self.places(at), size])


def _on_lines(kind: str, lines: list[_Line], least: float = 0.0) -> tuple[Array, Array, float]:
    """Features (k, 3) of a function along all `lines` of a boundary, and all its samples (n, c).

    And the departure that counts, which is `least` or more.
    """
    sampled = np.concatenate([line.sampled for line in lines])
    limit = max(_searched(kind, sampled)[1], least)
    found = [NO_JUMPS]
    for line in lines:
        components = np.hstack([line.sampled, -line.sampled]).T
        around = len(line.t) // 2 if line.closed else 0
        ends = components[:, len(line.t) - around :], components[:, :around]
        components = np.hstack([ends[0], components, ends[1]])
        for departure in _departures(components, limit)[:, around : around + len(line.t)]:
            changes = np.diff(np.concatenate([[0], (departure > 0).astype(int), [0]]))
            runs = np.flatnonzero(changes).reshape(-1, 2).tolist()
            if 0 < len(runs) <= FEATURES:  # more are roughness, which the estimate tells
                seen = [_feature(line, departure, first, last) for first, last in runs]
                at, widths = np.reshape(seen, (-1, 2)).T
                found.append(np.column_stack([line.places(at), widths]))
    return np.concatenate(found), sampled, limit


def _feature(line: _Line, departure: Array, first: int, last: int) -> tuple[float, float]:
    """Length along a line to the middle of a feature, `first` to `last` sample, and its width."""
    t = line.t
    low = t[first - 1] if first else 0.0
    high = t[last] if last < len(t) else line.ends[-1]
    fine, away = t[first:last], departure[first:last]
    if last - first < NARROW_SAMPLES:  # what is between samples counts
        fine = low + (high - low) * (np.arange(WIDTH_POINTS) + 0.5) / WIDTH_POINTS
        found = line.values(fine)
        # Both ends are beside the feature, unless the line ends there.
        base = found[[0 if first else -1, -1 if last < len(t) else 0]].mean(axis=0)
        away = np.abs(found - base).max(axis=1)
    most = away > away.max() / 2
    width = np.count_nonzero(most) / len(most) * (high - low)
    middle = np.median(fine[most]) if most.any() else (low + high) / 2
    return float(middle), max(width, MIN_WIDTH * line.spacing)


def _departures(values: Array, limit: float) -> Array:
    """Departure of each of `values` (c, n) in a peak, where it exceeds a limit; else 0."""
    found = np.zeros(values.shape)
    windows = [window for window in WINDOWS if window <= values.shape[1] / 2]
    lost = [_lost(values, window) for window in windows]
    for window, (now, then) in zip(windows, pairwise(lost), strict=False):
        some = (now > limit) & (then < LOSS_GROWTH * now)
        if not some.any():
            continue
        around = maximum_filter1d(values, window) - minimum_filter1d(values, window)
        some &= now > WINDOW_LOSS * around
        for peaks, size, value in zip(some, now, values, strict=True):
            for back in (1, -1):  # runs that reach an end
                n = int(np.argmin(np.append(peaks[::back], False)))
                most = WINDOW_LOSS * size[::back][:n].max(initial=0.0)
                if n and (window > END_WINDOW or _beyond(value[::back], n, window) <= most):
                    peaks[::back][:n] = False
        found = np.maximum(found, np.where(some, now, 0.0))
    return found


def _beyond(value: Array, n: int, window: int) -> float:
    """Largest distance of the first n samples from a polynomial through those of windows beside."""
    beside = np.arange(n, min(END_WINDOWS * window, len(value)))
    through = np.polynomial.Polynomial.fit(beside, value[beside], min(END_DEGREE, len(beside) - 1))
    return float(np.abs(value[:n] - through(np.arange(n))).max())


def _chains(view: SampledElements, segments: Index) -> list[tuple[Index, Mask]]:
    """The `segments` (k,) one after the other, as chains, and whether each is run backwards."""
    ends = view.arrays.facets[segments, ::-1].tolist()  # as NGSolve's parameter runs
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
    kind: str, function: Function, view: SampledElements, elements: Index
) -> tuple[Array, Array]:
    """Features (k, 3) of a function in a body, and all its samples (n, c)."""
    corners = view.arrays.corners[elements].reshape(-1, 2)
    spacing = BODY_SPACING * float(np.ptp(corners, axis=0).max())
    angle = LATTICE_ANGLE + np.array([0, np.pi / 3])
    sides = spacing * np.column_stack([np.cos(angle), np.sin(angle)])  # of the cells, as rows
    corners = corners @ np.linalg.inv(sides)
    origin = np.floor(corners.min(axis=0))
    shape = tuple(np.ceil(corners.max(axis=0) - origin).astype(int) + 1)
    places = (np.moveaxis(np.indices(shape), 0, -1) + origin) @ sides
    inside, values = _inside(function, view, elements, places)
    searched, limit = _searched(kind, values)
    flagged, windows = np.zeros(shape, dtype=bool), IN_PLANE[kind]
    wide = windows[-1]
    for component in searched.T:
        array = np.full(shape, np.nan)
        array[inside] = component
        steps = [np.abs(np.diff(array, axis=axis, append=np.nan)) for axis in (0, 1)]
        some = np.fmax(*steps) > limit / windows[0]  # a feature is left within half of the window
        if not some.any():
            continue
        part = tuple(slice(max(k.min() - wide, 0), k.max() + wide + 2) for k in np.nonzero(some))
        here = inside[part]
        for side in (array[part], -array[part]):  # beside a layer at the rim the rest is a valley
            lost = [np.where(here, _lost(side, window, here), 0) for window in windows]
            # Around convex corners of a part more is lost in the wide window, if not at a sample.
            for window, (now, then) in zip(windows[1:], pairwise(lost), strict=True):
                around = [uniform_filter(x, 2 * window + 1, mode="constant") for x in (now, then)]
                flagged[part] |= (now > limit) & (around[1] < LOSS_GROWTH * around[0])
    x = places[flagged]
    return np.column_stack([x, _widths(kind, function, view, x, spacing)]), values


def _inside(
    function: Function, view: SampledElements, elements: Index, places: Array
) -> tuple[Mask, Array]:
    """Which `places` (..., 2) are in `elements` (k,), (...,), and values (n, c) at these."""
    of, x = view.arrays.corners[elements], places.reshape(-1, 2)
    near = ((x >= of.min(axis=(0, 1))) & (x <= of.max(axis=(0, 1)))).all(axis=1)
    points = view.mesh(*x[near].T.copy())
    marked = np.zeros(len(view.sizes) + 1, dtype=bool)  # the last one for places outside
    marked[elements] = True
    inside = np.zeros(len(x), dtype=bool)
    inside[near] = met = marked[points["nr"]]
    return inside.reshape(places.shape[:-1]), _values(function, points[met])


def _widths(
    kind: str, function: Function, view: SampledElements, places: Array, spacing: float
) -> Array:
    """Widths (k,) of features at `places` (k, 2): the least chord at the nearest of some."""
    if not len(places):
        return np.empty(0)
    some = places[np.linspace(0, len(places) - 1, min(len(places), MEASURED_FEATURES)).astype(int)]
    t = spacing * np.geomspace(MIN_WIDTH, MAX_HALF_WIDTH, CHORD_POINTS)
    t = np.concatenate([-t[::-1], [0.0], t])
    angle, middle = LATTICE_ANGLE / 2 + np.pi / 3 * np.arange(3), CHORD_POINTS
    steps = t[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    x = some[:, None, None] + steps
    known, values = _inside(function, view, np.arange(len(view.sizes)), x)
    found = _searched(kind, values)[0]
    searched = np.zeros((*known.shape, found.shape[1]))
    searched[known] = found
    away = np.where(known, np.abs(searched - searched[:, middle, None]).max(axis=3), 0.0)
    same = away <= away.max(axis=1, keepdims=True) / 2
    up = np.cumprod(same[:, middle:], axis=1).sum(axis=1)
    down = np.cumprod(same[:, middle::-1], axis=1).sum(axis=1)
    width = (t[middle + up - 1] - t[middle - down + 1]).min(axis=1)
    width = np.maximum(width, MIN_WIDTH * spacing)
    apart = np.linalg.norm(some[:, None] - some, axis=2)
    width = np.where(apart <= width, width, 0.0).max(axis=1)  # chords near corners are shorter
    return np.asarray(width[cKDTree(some).query(places)[1]])


def towards(features: Array, cells: ElementParts, view: SampledElements) -> ElementParts:
    """The `cells`, halved at `features` (k, 3), places and widths, to the size of these."""
    done, tree = [], cKDTree(features[:, :2])
    middle = np.full((1, 1, view.dim), 1 / (view.dim + 1))
    while len(cells.element):
        at = cells.origin[:, None] + middle @ cells.side
        x = view.positions(cells.element, at[:, 0])
        size = view.sizes[cells.element] * np.abs(cells.side).sum(axis=2).max(axis=1)
        distance, nearest = tree.query(x)
        width = features[nearest, 2]
        near = (distance <= size + width) & (size > width)
        done.append(rows_of(cells, ~near))
        cells = rows_of(cells, near).divided(2)
    return joined(done)


def where_features_are(
    features: Array, view: SampledElements, elements: Index
) -> tuple[Index, Index]:
    """Elements (j,) of `elements` (k,) and features (j,) of `features` (n, 3) that meet.

    Features reach their width; in bodies the nearest stands for all.
    """
    if not len(features):
        return elements[:0], elements[:0]
    middle = np.full((len(elements), view.dim), 1 / (view.dim + 1))
    x, size = view.positions(elements, middle), view.sizes[elements]
    if view.dim == 2:
        distance, nearest = cKDTree(features[:, :2]).query(x)
        some = distance <= 0.6 * size + features[nearest, 2]
        return elements[some], nearest[some]
    distance = np.linalg.norm(x[:, None] - features[:, :2], axis=2)
    k, feature = np.nonzero(distance <= 0.5 * size[:, None] + features[:, 2])
    return elements[k], feature


def steps_along(values: Callable[[Array], Array], t: Array, known: Array) -> tuple[Array, Array]:
    """Places (j,) at which a function jumps along a line, and amounts (j,).

    Looked into are parts whose slope is not between those of their neighbours, as where a smooth
    function does not bend from one side to the other. Of their quarters the one is kept whose
    change differs most from that of the others, again and again: a smooth change shrinks by that,
    that of a jump does not. `values` are (k,) at any lengths (k,), `known` (n,) those at `t` (n,),
    at least four, ascending.
    """
    size, change, noise = np.diff(t), np.diff(known), STEADY_CHANGE * float(np.abs(known).max())
    part = np.flatnonzero(_odd(change / size, noise / float(np.median(size))))
    low, high, every = t[part], t[part + 1], np.arange(len(part))
    change = before = np.abs(change[part])
    for number in range(QUARTERINGS if len(part) else 0):
        places = low[:, None] * (1 - QUARTERS) + high[:, None] * QUARTERS  # exact at both ends
        steps = np.diff(values(places.ravel()).reshape(places.shape), axis=1)
        odd = np.abs(steps - np.median(steps, axis=1, keepdims=True)).argmax(axis=1)
        low, high = places[every, odd], places[every, odd + 1]
        change = np.abs(steps[every, odd])
        if number == QUARTERINGS // 2:
            before = change
    jumps = (change >= KEPT_CHANGE * before) & (change > noise)
    return low[jumps], change[jumps]


def _odd(slope: Array, noise: float) -> Mask:
    """Mask of slopes (n,) that are not between those of their neighbours, by more than `noise`.

    At ends not between that of the neighbour and one that goes on as the next two do, twice as far.
    """
    left = np.append(slope[1], slope[:-1])
    right = np.append(slope[1:], 3 * slope[-2] - 2 * slope[-3])
    right[0], left[0] = slope[1], 3 * slope[1] - 2 * slope[2]
    low, high = np.minimum(left, right), np.maximum(left, right)
    return np.asarray((slope < low - noise) | (slope > high + noise))


def unresolved(problem: Problem, mesh: ng.Mesh, *, in_bounds: bool = False) -> dict[str, Mask]:
    """Functions whose features are narrower than a mesh shows, or `in_bounds` of the error.

    In words, with the one that is narrowest beside its element, and triangles (ne,) too large.
    """
    limits, found = BOUND_WIDTHS if in_bounds else RESOLVED_WIDTHS, dict[str, Mask]()
    for one in features_of(problem, mesh):
        if one.kind not in limits or not len(one.spots):
            continue
        view = SampledElements(mesh, one.dim)
        region = mesh.Materials(one.name) if one.dim == 2 else mesh.Boundaries(one.name)
        at, feature = where_features_are(one.spots, view, view.inside(region))
        ratio = view.sizes[at] / one.spots[feature, 2]
        large = ratio > limits[one.kind]
        if one.kind == "traction":  # straight segments are cut at features
            middle = view.positions(at, np.full((len(at), 1), 0.5))
            off = np.linalg.norm(middle - view.arrays.vertices[view.ends[at]].mean(axis=1), axis=1)
            large &= off > CHORD_DISTANCE * view.sizes[at]
        if not large.any():
            continue
        elements = np.bincount(at[large], minlength=len(view.sizes)) > 0
        if view.dim == 1:  # triangles at such segments
            ends = np.isin(view.arrays.elements, view.ends[elements])
            elements = np.asarray(ends.sum(axis=1) > 1)
        worst = int(np.argmax(np.where(large, ratio, 0.0)))
        (x, y, width), size = one.spots[feature[worst]], view.sizes[at[worst]]
        words = (
            f'{one.kind} "{one.name}" has a feature {width:.2g} wide near ({x:.4g}, {y:.4g}), '
            f"in an element of size {size:.2g}"
        )
        found[words] = elements | found.get(words, False)
    return found
