"""Pictures of convergence, with triangles that show rates."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..estimator import Guaranteed
from .files import check_path
from .pictures import colour_and_mark, new_figure, show

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRIANGLE_SPAN = 2.5  # of a triangle's side along the unknowns
TRIANGLE_DEPTH = 0.6  # of the curve, where a triangle lies

Run = Sequence[Guaranteed] | tuple[Any, Any]


def slope_triangle(axes: Axes, x: Array, y: Array, rate: float) -> None:
    """A triangle of the slope -`rate` below the end of a curve `x`, `y` (k,), both logarithmic."""
    right, end = float(x[-1]), TRIANGLE_DEPTH * float(y[-1])
    left, start = right / TRIANGLE_SPAN, end * TRIANGLE_SPAN**rate
    axes.plot([left, right, left, left], [start, end, end, start], color="0.4", lw=0.8)
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "color": "0.3"}
    for text, place, offset, ha, va in (
        (f"{rate:g}", (left, np.sqrt(end * start)), (-3, 0), "right", "center"),
        ("1", (np.sqrt(left * right), end), (0, -2), "center", "top"),
    ):
        axes.annotate(text, place, xytext=offset, ha=ha, va=va, **beside)


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
    for label, run in named.items():
        if len(run[0] if isinstance(run, tuple) else run) == 0:
            raise ValueError(f'run "{label}" is empty')
    target = None if path is None else check_path(path, ".png")
    figure = new_figure(target, figsize=(6.5, 5))
    axes = figure.subplots()
    for k, (label, run) in enumerate(named.items()):
        name, rate, colour, mark = label, (rates or {}).get(label), *colour_and_mark(k)
        style: dict[str, Any] = {"color": colour, "marker": mark, "ms": 4}
        if isinstance(run, tuple):
            x, y = (np.asarray(values, dtype=float) for values in run)
        else:
            order = run[-1].order
            name, rate = label or f"estimate, order {order}", order / 2 if rate is None else rate
            sizes = [level.displacement.space.ndof for level in run]
            levels = list(zip(sizes, run, strict=True))
            x, y = np.transpose([(n, level.relative_error_estimate) for n, level in levels])
            if bound := [(n, one.relative_error_bound) for n, one in levels if one.bounded]:
                bound_name = f"{label}, bound".lstrip(", ")
                axes.plot(*np.transpose(bound), ls="--", mfc="w", label=bound_name, **style)
        axes.plot(x, y, label=name, **style)
        if rate is not None:
            slope_triangle(axes, x, y, rate)
    axes.set(xscale="log", yscale="log", xlabel="unknowns", ylabel="relative error, energy norm")
    axes.grid(which="major", alpha=0.3)
    axes.legend()
    show(figure, target)
    return figure
