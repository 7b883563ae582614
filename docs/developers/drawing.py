"""A house of boxes on floors, with arrows that cross no box.

Each floor is ordered so that few arrows cross (Sugiyama, Tagawa, Toda 1981); where boxes stand is
a contact problem, solved by `ngcontact.solve_qp`.
"""

from __future__ import annotations

from itertools import pairwise
from textwrap import fill

import numpy as np
import scipy.sparse as sp
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, PathPatch
from matplotlib.path import Path

from ngcontact import solve_qp

WIDTH, HEIGHT, STOREY = 2.9, 0.8, 1.16  # of a box and of a floor, inches
LANE, SPACE = 0.1, 0.3  # width of an arrow that passes a floor; between boxes
MARGIN = 0.35
LETTERS = 15.5  # an inch
STARTS, SWEEPS = 40, 8  # of the search for an order with few crossings
STRAIGHT, CENTRED = 6.0, 0.3  # stiffness of arrows that pass floors; pull to the middle
INK, PAPER, STRIPE = "#26323e", "#ffffff", "#f5f6f7"
COLOURS = {True: ("#dcebf7", "#3f7fb5"), False: ("#e3f1de", "#5b9a49")}  # face and edge

Point = tuple[float, float]


class Storeys:
    """Boxes and passing arrows of each floor, from left to right.

    An arrow over several floors takes a lane of its own in each floor between, so that it crosses
    no box.
    """

    def __init__(self, floors: list[list[str]], arrows: dict[str, set[str]]) -> None:
        self.rows: list[list[str]] = [list(floor) for floor in floors]
        level = {room: k for k, floor in enumerate(floors) for room in floor}
        self.ways: list[list[str]] = []
        for room, targets in arrows.items():
            for target in sorted(targets):
                lanes = [f"{room}>{target}@{k}" for k in range(level[room] + 1, level[target])]
                for k, lane in enumerate(lanes, level[room] + 1):
                    self.rows[k].append(lane)
                self.ways.append([room, *lanes, target])
        self.steps = [pair for way in self.ways for pair in pairwise(way)]

    def crossings(self) -> int:
        """Number of pairs of arrows that cross between two floors."""
        at = {name: (k, i) for k, row in enumerate(self.rows) for i, name in enumerate(row)}
        ends = [(*at[a], at[b][1]) for a, b in self.steps]
        return sum(
            k == other and (i - j) * (p - q) < 0
            for n, (k, i, p) in enumerate(ends)
            for other, j, q in ends[:n]
        )

    def sort(self) -> None:
        """Order the floors so that few arrows cross, the best of some first orders."""
        rng = np.random.default_rng(0)
        best, least = self.rows, self.crossings()
        for _ in range(STARTS):
            self.rows = [rng.permutation(row).tolist() for row in best]
            for sweep in range(SWEEPS):
                self._sweep(down=sweep % 2 == 0)
                if (count := self.crossings()) < least:
                    best, least = [list(row) for row in self.rows], count
        self.rows = best

    def _sweep(self, down: bool) -> None:
        """Order each floor by the mean place of its neighbours on the floor above, or below."""
        order = range(1, len(self.rows)) if down else range(len(self.rows) - 2, -1, -1)
        for k in order:
            near = self.rows[k - 1 if down else k + 1]
            linked: dict[str, list[float]] = {name: [] for name in self.rows[k]}
            for step in self.steps:
                here, there = step[::-1] if down else step
                if here in linked:
                    linked[here].append((near.index(there) + 0.5) / len(near))
            mean = {
                name: float(np.mean(at)) if at else (i + 0.5) / len(self.rows[k])
                for i, (name, at) in enumerate(linked.items())
            }
            self.rows[k].sort(key=mean.__getitem__)

    def places(self) -> dict[str, float]:
        """Middles of boxes and lanes: arrows as upright as boxes that do not overlap allow.

        Neighbours on a floor keep their distance, a contact problem for `solve_qp`.
        """
        names = [name for row in self.rows for name in row]
        at = {name: i for i, name in enumerate(names)}
        n = len(names)
        A = sp.lil_array((n, n))
        for a, b in self.steps:
            stiffness = STRAIGHT ** sum(">" in name for name in (a, b))
            for i, j in ((at[a], at[b]), (at[b], at[a])):
                A[i, i] += stiffness
                A[i, j] -= stiffness
        A.setdiag(A.diagonal() + np.where([">" in name for name in names], 1e-3, CENTRED))
        pairs = [pair for row in self.rows for pair in pairwise(row)]
        B = sp.lil_array((len(pairs), n))
        g = np.zeros(len(pairs))
        for k, (left, right) in enumerate(pairs):
            B[k, at[left]], B[k, at[right]] = 1.0, -1.0
            g[k] = -SPACE - sum(LANE if ">" in name else WIDTH for name in (left, right)) / 2
        x = solve_qp(A.tocsr(), np.zeros(n), B.tocsr(), g).u
        return dict(zip(names, x.tolist(), strict=True))


def _box(axes: Axes, middle: Point, width: float, name: str, words: str, meshes: bool) -> None:
    x, y = middle
    face, edge = COLOURS[meshes]
    corner = x - width / 2, y - HEIGHT / 2
    style = "round,pad=0,rounding_size=0.08"
    axes.add_patch(
        FancyBboxPatch(
            corner, width, HEIGHT, boxstyle=style, facecolor=face, edgecolor=edge, zorder=3
        )
    )
    looks = {"ha": "center", "color": INK, "zorder": 4}
    top = y + HEIGHT / 2 - 0.07
    axes.text(x, top, name, va="top", fontsize=11.5, fontweight="bold", **looks)
    lines = fill(words, int(LETTERS * width))
    axes.text(x, y - 0.14, lines, va="center", fontsize=8.3, linespacing=1.15, **looks)


def _arrow(axes: Axes, points: list[Point]) -> None:
    """A smooth line through `points`, upright at each, with a head at the last."""
    vertices, codes = [points[0]], [Path.MOVETO]
    for (xa, ya), (xb, yb) in pairwise(points):
        middle = (ya + yb) / 2
        vertices += [(xa, middle), (xb, middle), (xb, yb)]
        codes += [Path.CURVE4] * 3
    axes.add_patch(
        PathPatch(Path(vertices, codes), facecolor="none", edgecolor=INK, linewidth=1.1, zorder=2)
    )
    x, y = points[-1]
    axes.fill([x - 0.05, x + 0.05, x], [y + 0.11, y + 0.11, y], color=INK, zorder=2)


def _way(storeys: Storeys, x: dict[str, float], y: dict[str, float], way: list[str]) -> list[Point]:
    """Points of an arrow: from below a box through its lanes to above another box."""

    def port(room: str, other: str, side: int) -> Point:
        """Where the arrow from or to `other` meets the lower (0) or upper (1) side of a box."""
        others = [step[1 - side] for step in storeys.steps if step[side] == room]
        place = sorted(others, key=x.__getitem__).index(other) - (len(others) - 1) / 2
        return x[room] + place * min(0.4, 2.0 / len(others)), y[room] + (side - 0.5) * HEIGHT

    through = [
        (x[lane], y[lane] + half) for lane in way[1:-1] for half in (HEIGHT / 2, -HEIGHT / 2)
    ]
    return [port(way[0], way[1], 0), *through, port(way[-1], way[-2], 1)]


def picture(
    floors: list[list[str]],
    arrows: dict[str, set[str]],
    ground: list[str],
    words: dict[str, str],
    meshes: dict[str, bool],
) -> Figure:
    """The house: rooms by floor, top down, with their arrows, and the `ground` that serves all.

    `words` say what a room holds, `meshes` whether it loads NGSolve.
    """
    storeys = Storeys(floors, arrows)
    storeys.sort()
    x = storeys.places()
    y = {name: (len(floors) - k) * STOREY for k, row in enumerate(storeys.rows) for name in row}
    rooms = [room for floor in floors for room in floor]
    left = min(x[room] for room in rooms) - WIDTH / 2
    right = max(x[room] for room in rooms) + WIDTH / 2
    axes = _sheet(left - MARGIN, right + MARGIN, len(floors))
    for room in rooms:
        _box(axes, (x[room], y[room]), WIDTH, room, words[room], meshes[room])
    for way in storeys.ways:
        _arrow(axes, _way(storeys, x, y, way))
    width = (right - left + SPACE / 2) / len(ground)
    for k, room in enumerate(ground):
        middle = left - SPACE / 4 + (k + 0.5) * width, 0.0
        _box(axes, middle, width - SPACE / 2, room, words[room], meshes[room])
    _legend(axes, left, right)
    return axes.figure


def _sheet(left: float, right: float, storeys: int) -> Axes:
    """Empty axes in inches, every other floor shaded."""
    bottom, top = -0.75, (storeys + 0.5) * STOREY
    figure = Figure(figsize=(right - left, top - bottom), facecolor=PAPER)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.axis("off")
    for k in range(storeys, 0, -2):
        axes.axhspan((k - 0.5) * STOREY, (k + 0.5) * STOREY, facecolor=STRIPE, zorder=0)
    return axes


def _legend(axes: Axes, left: float, right: float) -> None:
    y = -0.56
    style = "round,pad=0,rounding_size=0.03"
    looks = {"va": "center", "fontsize": 8, "color": INK}
    for k, (meshes, words) in enumerate({True: "loads NGSolve", False: "arrays only"}.items()):
        face, edge = COLOURS[meshes]
        at = left + 1.6 * k
        corner = at, y - 0.07
        axes.add_patch(
            FancyBboxPatch(corner, 0.22, 0.14, boxstyle=style, facecolor=face, edgecolor=edge)
        )
        axes.text(at + 0.3, y, words, **looks)
    axes.text(
        right,
        y,
        "an arrow: imports from; what follows from other arrows is left out, "
        "and the lowest floor serves all",
        ha="right",
        **looks,
    )
