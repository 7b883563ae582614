"""The solution: displacement, pressure, gap, forces, errors, tables, files and pictures."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import ngsolve as ng
import numpy as np

from . import __version__
from .adaptivity import RefinementTree
from .discrete import DiscreteProblem
from .estimator import Measured
from .output import Profile, Unit, plot_solids, plot_solution, write_revolved, write_solution
from .qp import Iterate
from .results import (
    Number,
    Values,
    line_of,
    read,
    record_of,
    restored,
    save,
    state_of,
    values_at,
)


@dataclass(frozen=True, eq=False)
class Solution(Measured):
    """Exact minimiser u_h of L over K_h on one mesh: HH81 (P_1h), (P_2h).

    Contact quantities are arrays over the m contact points, all pairs in order.

    Attributes
    ----------
    problem : Problem
        What was solved.
    mesh : ng.Mesh
        The (curved) mesh.
    order : int
        Polynomial degree of the displacement.
    element : str
        "isoparametric", "superparametric" or "physical".
    displacement : ng.GridFunction
        u_h, a length, on a VectorH1 space; "unknowns" means ``displacement.space.ndof``.
    discrete : DiscreteProblem
        The algebraic problem.
    minimiser : Iterate
        Its solution.
    work : dict
        Counts of assemblies, factorizations, back_solves, gap_searches, curved_elements, estimates
        and equilibrations spent on this solution, on its mesh. Without factorisation V-cycles of
        multigrid count as back_solves. And evaluations: points at which functions among the data
        were looked at for warnings, jumps and roughness, in `adapt` by the level itself; beside
        those are checks that data are finite, interpolation and quadrature. 0 where all data are
        numbers.
    adaptive : bool
        Whether it is a level of `adapt`, whose estimate is needed anyway.
    earlier : tuple of ndarray (c, 8)
        Of c pairs of solids what `quantities` tells, on up to two levels of `adapt` before.
    tree : RefinementTree
        The first mesh of a run, and which of its elements those of `mesh` are parts of.
    coarse_levels : int
        Levels of the coarse adaptive run that gave `solve` the first active set of a large mesh.
    """

    tree: RefinementTree = field(kw_only=True)
    coarse_levels: int = 0

    def at(self, points: Any, *, body: str | None = None, outside: str = "error") -> Values:
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
        self,
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

    def record(self) -> dict[str, Number]:
        """One row of a table: a flat dict of plain numbers, in any consistent units.

        Sizes and counts, energy, forces and peak pressure by number of the pair, reactions by name
        of the boundary, residuals, work. The columns of a problem are always the same: estimate
        and bound are NaN unless they have been made, or the solution is a level of `adapt`.
        """
        return record_of(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write everything to `path` (.ngcontact), for `ngcontact.load` in another process.

        Raises
        ------
        TypeError
            Data that cannot be pickled, like a gap given by a lambda, with the name.
        ValueError, OSError
            A name that does not end in .ngcontact, a folder that cannot be written to.
        """
        return save(self, path, __version__)

    def draw(self) -> object:
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

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling and copying, without factorisations."""
        return state_of(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the rest again."""
        vars(self).update(restored(state))

    def __str__(self) -> str:
        """One line: unknowns, active points, steps, pairs' forces; estimate, bound if known."""
        return line_of(self)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write `path` (.vtu) and, beside it, ``<stem>_contact.vtp``."""
        return write_solution(path, self)

    def revolved(self, path: str | os.PathLike[str], angle: float = 270.0) -> Path:
        """Write the body of revolution, turned by `angle` degrees, to `path` (.vtu)."""
        return write_revolved(path, self, angle)

    def plot(
        self,
        path: str | os.PathLike[str] | None = None,
        scale: float | None = None,
        *,
        field: str | ng.CoefficientFunction = "von_mises",
        limits: tuple[float, float] | None = None,
        units: Mapping[str, Unit] | None = None,
        profile: Mapping[str, Profile] | None = None,
        mesh: bool = True,
        mirror: str | None = None,
    ) -> None:
        """Picture of the deformed bodies, close-ups of zones in contact, and the pressure.

        Parameters
        ----------
        path : path, optional
            File (.png); without one the picture is shown on the screen.
        scale : float, optional
            Factor of the displacement; chosen to be seen when left out.
        field : str or ng.CoefficientFunction
            What colours show: "von_mises", "displacement", "displacement_x", "displacement_y",
            "stress_xx", "stress_yy", "stress_xy", "stress_zz", "largest_principal",
            "smallest_principal", "mean_pressure", or a real function. Of bodies of revolution
            the coordinates are r and z, and "stress_hoop" takes the place of "stress_zz".
        limits : tuple of float, optional
            Ends of the colour scale in the unit of the data. Default: the range of the bodies and
            of the zones in contact without single peaks, as at corners; an arrow and a number on
            the scale say what lies beyond.
        units : mapping, optional
            Of "length" and "stress": a name, or a name and its size in the unit of the data, as
            ``{"length": ("mm", 1e-3), "stress": ("MPa", 1e6)}``.
        profile : mapping, optional
            What is drawn over the pressure, by label: functions of the coordinate (k,) along the
            contact line, or pairs of arrays, coordinates and pressures in the unit of the data.
        mesh : bool
            Whether edges of elements are drawn.
        mirror : str, optional
            A straight boundary, a line of symmetry, at which the bodies are mirrored. Bodies of
            revolution always are at their axis.

        Raises
        ------
        ValueError, TypeError, OSError
            An option that is none, a path that cannot be written: before any work. A boundary
            `mirror` that is no line of symmetry.
        """
        options = {"units": units or {}, "profile": profile or {}, "mesh": mesh, "mirror": mirror}
        draw = plot_solids if self.problem.dim == 3 else plot_solution
        draw(self, path, scale, field=field, limits=limits, **options)

    __repr__ = __str__  # instead of all arrays


def solution_of(
    minimiser: Iterate, tried: Sequence[DiscreteProblem], element: str, curved: int
) -> Solution:
    """The solution of the last of the problems `tried`, with counts of what all of them took."""
    discrete, trace = tried[-1], tried[-1].space.trace
    work = {
        "assemblies": sum(one.assembled for one in tried),
        "factorizations": minimiser.factorizations,
        "back_solves": minimiser.back_solves,
        "gap_searches": sum(line.searches for one in tried for line in one.lines),
        "curved_elements": curved,
    }
    return Solution(
        problem=discrete.problem,
        mesh=trace.mesh,
        order=trace.order,
        element=element,
        displacement=discrete.displacement(minimiser.u, discrete.space.right_side),
        discrete=discrete,
        minimiser=minimiser,
        work=work | dict.fromkeys(("estimates", "equilibrations", "evaluations"), 0),
        tree=RefinementTree(trace.mesh, np.arange(trace.mesh.ne)),
    )


def load(path: str | os.PathLike[str]) -> Solution:
    """The solution that `Solution.save` wrote to `path`.

    Displacement and contact are equal to the last bit. The stiffness is assembled again, and
    factorised when it is next needed. The file is a pickle: load only what you or people you trust
    have written.

    Raises
    ------
    ValueError
        A file that is no result, is not complete, or is of a version that cannot be read here.
    """
    solution: Solution = read(path, __version__)
    return solution
