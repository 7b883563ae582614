"""Pictures of convergence, with triangles that show rates."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..arrays import Array
from .files import check_path, replacing
from .pictures.scene import COLOURS, MARKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPAN = 2.5  # of a triangle's side along the unknowns
BELOW = 0.6  # of the curve, where a triangle lies


class Level(Protocol):
    """A solution with its error estimate, and its bound where that has been made."""

    @property
    def order(self) -> int:
        """Degree of the displacement."""

    @property
    def displacement(self) -> Any:
        """u_h, whose space knows the unknowns."""

    @property
    def relative_error_estimate(self) -> float:
        """Estimated error over the energy norm."""

    @property
    def bounded(self) -> bool:
        """Whether the bound has been made."""

    @property
    def relative_error_bound(self) -> float:
        """Bound of the error over the energy norm."""


Run = Sequence[Level] | tuple[Any, Any]


@dataclass(frozen=True, eq=False)
class Curve:
    """What is drawn of one run.

    Attributes
    ----------
    name : str
        In the legend.
    x, y, bound : ndarray (k,)
        Unknowns, errors, and bounds, NaN where there are none.
    rate : float or None
        Of its triangle.
    """

    name: str
    x: Array
    y: Array
    bound: Array
    rate: float | None


def slope_triangle(axes: Axes, x: Array, y: Array, rate: float, above: bool = False) -> None:
    """A triangle at the end of a curve in logarithmic axes, of the slope -`rate`.

    Parameters
    ----------
    axes : Axes
        With logarithmic scales.
    x, y : ndarray (k,)
        The curve.
    rate : float
        Exponent: y falls like x to the power -`rate`.
    above : bool
        Whether the triangle lies above the curve and not below.
    """
    corners, upright, level = _triangle(x, y, rate, above)
    axes.plot(*corners.T, color="0.4", lw=0.8)
    sideways, up = (3, 2) if above else (-3, -2)
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "color": "0.3"}
    axes.annotate(
        f"{rate:g}",
        (upright[0], upright[1]),
        xytext=(sideways, 0),
        ha="left" if above else "right",
        va="center",
        **beside,
    )
    axes.annotate(
        "1",
        (level[0], level[1]),
        xytext=(0, up),
        ha="center",
        va="bottom" if above else "top",
        **beside,
    )


def _triangle(x: Array, y: Array, rate: float, above: bool) -> tuple[Array, Array, Array]:
    """Corners (4, 2) of a triangle, closed, and the middles (2,) of its upright and level sides."""
    right = float(x[-1])
    left = right / SPAN
    end = float(y[-1]) * (1 / BELOW if above else BELOW)
    start = end * SPAN**rate
    corner = (right, start) if above else (left, end)
    corners = np.array([(left, start), (right, end), corner, (left, start)])
    middle = np.sqrt(start * end), np.sqrt(left * right)
    return corners, np.array([corner[0], middle[0]]), np.array([middle[1], corner[1]])


def _crossed(corners: Array, curves: Sequence[Curve]) -> int:
    """How many points of `curves`, and of the lines between, lie in the box of a triangle."""
    low, high = np.log(corners.min(axis=0)), np.log(corners.max(axis=0))
    count = 0
    for curve in curves:
        x, y = np.log(curve.x), np.log(curve.y)
        at = np.linspace(low[0], high[0], 50)
        there = np.interp(at, x, y, left=np.nan, right=np.nan)
        count += int(np.count_nonzero((there > low[1]) & (there < high[1])))
    return count


def plot_convergence(
    runs: Mapping[str, Run] | Sequence[Level],
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
    named: dict[str, Run]
    named = {str(k): run for k, run in runs.items()} if isinstance(runs, Mapping) else {"": runs}
    if unknown := set(rates or {}) - set(named):
        raise ValueError(f"rates: no run is called {', '.join(sorted(unknown))}")
    for label, run in named.items():
        if len(run) == 0 or (isinstance(run, tuple) and len(run[0]) == 0):
            raise ValueError(f'run "{label}" is empty')
    target = None if path is None else check_path(path, ".png")
    from matplotlib.figure import Figure

    if target is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(6.5, 5), layout="constrained")
    else:
        figure = Figure(figsize=(6.5, 5), layout="constrained")
    _draw(figure.subplots(), named, rates or {})
    if target is None:
        pyplot.show()
        return figure
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with replacing(target) as (draft,):
        FigureCanvasAgg(figure).print_figure(draft, format="png", dpi=150)
    return figure


def _curve(label: str, run: Run) -> Curve:
    """Name and arrays of one run."""
    if isinstance(run, tuple):
        x, y = (np.asarray(values, dtype=float) for values in run)
        return Curve(label, x, y, np.full(len(x), np.nan), None)
    order = run[-1].order
    return Curve(
        name=label or f"estimate, order {order}",
        x=np.array([level.displacement.space.ndof for level in run], dtype=float),
        y=np.array([level.relative_error_estimate for level in run]),
        bound=np.array([s.relative_error_bound if s.bounded else np.nan for s in run]),
        rate=order / 2,
    )


def _draw(axes: Axes, runs: Mapping[str, Run], rates: Mapping[str, float]) -> None:
    """All curves with their triangles."""
    curves = {label: _curve(label, run) for label, run in runs.items()}
    for k, (label, curve) in enumerate(curves.items()):
        style: dict[str, Any] = {
            "color": COLOURS[k % len(COLOURS)],
            "marker": MARKS[k % len(MARKS)],
        }
        axes.plot(curve.x, curve.y, label=curve.name, ms=4, **style)
        known = np.isfinite(curve.bound)
        if known.any():
            name = f"{label}, bound".lstrip(", ")
            bound = curve.x[known], curve.bound[known]
            axes.plot(*bound, ls="--", mfc="w", label=name, ms=4, **style)
        rate = rates.get(label, curve.rate)
        if rate is not None:
            others = [other for other in curves.values() if other is not curve]
            places = [_triangle(curve.x, curve.y, rate, above)[0] for above in (False, True)]
            under, over = (_crossed(place, others) for place in places)
            slope_triangle(axes, curve.x, curve.y, rate, above=over < under)
    axes.set(xscale="log", yscale="log", xlabel="unknowns", ylabel="relative error, energy norm")
    axes.grid(which="major", alpha=0.3)
    axes.legend()
