"""Pictures of convergence, with triangles that show rates."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..estimator import Guaranteed
from .files import check_path
from .pictures import COLOURS, MARKS, new_figure, show

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRIANGLE_SPAN = 2.5  # of a triangle's side along the unknowns
TRIANGLE_DEPTH = 0.6  # of the curve, where a triangle lies

Run = Sequence[Guaranteed] | tuple[Any, Any]


def slope_triangle(axes: Axes, x: Array, y: Array, rate: float, above: bool = False) -> None:
    """A triangle of the slope -`rate` at the end of a curve `x`, `y` (k,) in logarithmic axes.

    It lies below the curve, or `above`.
    """
    corners = _triangle(x, y, rate, above)
    axes.plot(*corners.T, color="0.4", lw=0.8)
    (left, start), (_, end), corner, _ = corners
    upright, level = (corner[0], np.sqrt(end * start)), (np.sqrt(left * float(x[-1])), corner[1])
    one, other = ((3, 0), (0, 2)) if above else ((-3, 0), (0, -2))
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "color": "0.3"}
    side, va = ("left", "bottom") if above else ("right", "top")
    axes.annotate(f"{rate:g}", upright, xytext=one, ha=side, va="center", **beside)
    axes.annotate("1", level, xytext=other, ha="center", va=va, **beside)


def _triangle(x: Array, y: Array, rate: float, above: bool) -> Array:
    """Corners (4, 2) of a triangle, closed; the third one is at the right angle."""
    right = float(x[-1])
    left = right / TRIANGLE_SPAN
    end = float(y[-1]) * (1 / TRIANGLE_DEPTH if above else TRIANGLE_DEPTH)
    start = end * TRIANGLE_SPAN**rate
    corner = (right, start) if above else (left, end)
    return np.array([(left, start), (right, end), corner, (left, start)])


def _crossed(corners: Array, curves: Sequence[tuple[Array, Array]]) -> int:
    """Number of points of `curves`, and of the lines between, in the box of a triangle."""
    low, high = np.log(corners.min(axis=0)), np.log(corners.max(axis=0))
    at, count = np.linspace(low[0], high[0], 50), 0
    for x, y in curves:
        there = np.interp(at, np.log(x), np.log(y), left=np.nan, right=np.nan)
        count += int(np.count_nonzero((there > low[1]) & (there < high[1])))
    return count


def plot_convergence(
    runs: Mapping[str, Run] | Sequence[Guaranteed],
    path: str | os.PathLike[str] | None = None,
    *,
    rates: Mapping[str, float] | None = None,
) -> Figure:
    """Relative errors over unknowns, with a triangle of the optimal rate under each curve.

    Parameters
    ----------
    runs : mapping or sequence of Solution
        By label: levels of `adapt` or solutions on finer and finer meshes, drawn by their error
        estimates and, where they have been made, guaranteed bounds (dashed); or two arrays,
        unknowns (k,) and relative errors (k,). One run may be given as it is.
    path : path, optional
        File (.png); without one the picture is shown on the screen.
    rates : mapping, optional
        Rates of the triangles by label. Default: order / 2 of solutions, no triangle for arrays.

    Returns
    -------
    Figure
        Of matplotlib.

    Raises
    ------
    ValueError, OSError
        An empty run, a rate without a run, a path that cannot be written.
    """
    named = {str(k): run for k, run in runs.items()} if isinstance(runs, Mapping) else {"": runs}
    if unknown := set(rates or {}) - set(named):
        raise ValueError(f"rates: no run is called {', '.join(sorted(unknown))}")
    curves = {}
    for label, run in named.items():
        if isinstance(run, tuple):
            curves[label] = x, _ = np.asarray(run[0], float), np.asarray(run[1], float)
        else:
            x = np.array([float(level.displacement.space.ndof) for level in run])
            curves[label] = x, np.array([level.relative_error_estimate for level in run])
        if len(x) == 0:
            raise ValueError(f'run "{label}" is empty')
    target = None if path is None else check_path(path, ".png")
    figure = new_figure(target, figsize=(6.5, 5))
    axes = figure.subplots()
    for k, (label, run) in enumerate(named.items()):
        (x, y), rate, name = curves[label], (rates or {}).get(label), label
        style: dict[str, Any] = {
            "color": COLOURS[k % len(COLOURS)],
            "marker": MARKS[k % len(MARKS)],
        }
        known = []
        if not isinstance(run, tuple):
            order = run[-1].order
            name, rate = label or f"estimate, order {order}", order / 2 if rate is None else rate
            known = [level for level in run if level.bounded]
        axes.plot(x, y, label=name, ms=4, **style)
        if known:
            size = [float(level.displacement.space.ndof) for level in known]
            bound = [level.relative_error_bound for level in known]
            name = f"{label}, bound".lstrip(", ")
            axes.plot(size, bound, ls="--", mfc="w", label=name, ms=4, **style)
        if rate is not None:
            others = [curve for other, curve in curves.items() if other != label]
            places = [_triangle(x, y, rate, above) for above in (False, True)]
            under, over = (_crossed(place, others) for place in places)
            slope_triangle(axes, x, y, rate, above=over < under)
    axes.set(xscale="log", yscale="log", xlabel="unknowns", ylabel="relative error, energy norm")
    axes.grid(which="major", alpha=0.3)
    axes.legend()
    show(figure, target)
    return figure
