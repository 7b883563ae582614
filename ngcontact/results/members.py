"""What a solution tells of itself at points of its bodies."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..arrays import Array
from .archive import Kept, restored, save, state_of
from .record import Number, _Recorded, record_of
from .text import _Told, html_of, line_of
from .values import Solved, Values, values_at


class Readable:
    """Members of `Solution` that read it."""

    @property
    def direction(self: _Recorded) -> Array:
        """Unit direction d (m, 2) of each point, from the secondary to the primary, dimensionless.

        The traction on the secondary is -pressure d, the force of a point on it -force d.
        """
        return np.concatenate([np.zeros((0, 2)), *(pair.line.direction for pair in self.pairs)])

    def at(self: Solved, points: Any, *, body: str | None = None, outside: str = "error") -> Values:
        """Displacement, stress, von Mises and principal stresses at points, any consistent units.

        Parameters
        ----------
        points : array_like (..., 2)
            Where, before deformation: one point, a list of points, a grid.
        body : str, optional
            Name or pattern of the body: of two bodies that share the point, as on a contact line.
        outside : str
            "error", or "nan" for NaN at points that lie in no body, or not in `body`.

        Returns
        -------
        Values
            Arrays of the shape of `points`: `.displacement`, `.stress`, `.out_of_plane_stress`,
            `.von_mises`, `.principal_stresses`, and the name of the `.body`.

        Raises
        ------
        ValueError, TypeError
            Points in no body or in several, with the first of them; a name that is none.
        """
        return values_at(self, points, body, outside)

    def along(
        self: Solved,
        start: Sequence[float],
        end: Sequence[float],
        count: int = 101,
        *,
        body: str | None = None,
        outside: str = "error",
    ) -> Values:
        """Values at `count` points of the line from `start` to `end`, any consistent units.

        `.distance` is the length of the way from `start`. `body`, `outside` and what is refused as
        in `at`.
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 2:
            raise ValueError(f"count={count!r}: give a number of points, at least 2")
        share = np.linspace(0, 1, int(count))[:, None]
        a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        return values_at(self, (1 - share) * a + share * b, body, outside)

    def record(self: _Recorded) -> dict[str, Number]:
        """One row of a table: a flat dict of plain numbers, in any consistent units.

        Sizes and counts, energy, forces and peak pressure by number of the pair, reactions by name
        of the boundary, residuals, work. The columns of a problem are always the same: estimate
        and bound are NaN unless they have been made, or the solution is a level of `adapt`.
        """
        return record_of(self)

    def save(self: Kept, path: str | os.PathLike[str]) -> Path:
        """Write everything to `path` (.ngcontact), for `ngcontact.load` in another process.

        Raises
        ------
        TypeError
            Data that cannot be pickled, like a gap given by a lambda, with the name.
        ValueError, OSError
            A name that does not end in .ngcontact, a folder that cannot be written to.
        """
        return save(self, path, __version__)

    def draw(self: Solved) -> object:
        """Draw the displacement in a notebook with NGSolve's webgui.

        Raises
        ------
        ImportError
            What the extra `notebook` installs is not there.
        """
        self.discrete.space.require_mesh()
        for package in ("anywidget", "IPython"):
            if find_spec(package) is None:
                raise ImportError(
                    f"draw() needs {package}, which is not installed: pip install "
                    "'ngcontact[notebook]', or use plot(), which needs nothing"
                )
        with np.errstate():  # NGSolve's module changes how NumPy warns, for the whole process
            from ngsolve.webgui import Draw

        return Draw(self.displacement, self.mesh, deformation=True)

    def __getstate__(self: Kept) -> dict[str, Any]:
        """What is pickled and copied: factorisations stay behind."""
        return state_of(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the rest again."""
        vars(self).update(restored(state))

    def __str__(self: _Told) -> str:
        """One line: unknowns, active points, steps, pairs' forces; estimate, bound if known."""
        return line_of(self)

    def _repr_html_(self: _Told) -> str:
        """What a notebook shows."""
        return html_of(self)
