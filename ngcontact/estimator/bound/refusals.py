"""Problems for which no bound is known: refused by name, before any work."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...contact import ContactState
from ...fem import BoundaryTrace
from ...problem import Problem
from ...quadrature import features_of, unresolved

NO_BOUND = "no guaranteed bound is known"


def refuse_bound(problem: Problem, boundary: BoundaryTrace, pairs: Sequence[ContactState]) -> None:
    """Raise unless the error of a problem's solutions can be bounded.

    Raises
    ------
    ValueError
        What stands in the way.
    """
    bent = boundary.curved_segments
    axis = boundary.model.on_axis(boundary.curve[:, [0, -1]].reshape(-1, 2)).reshape(-1, 2)
    for refused, what in (
        (bent & boundary.inner, "curved lines inside a body"),
        (bent & axis.any(axis=1), "curves that meet the axis"),
    ):
        if refused.any():
            name = boundary.mesh.GetBoundaries()[boundary.region[refused.argmax()]]
            raise ValueError(f'{NO_BOUND} for {what}, as "{name}"; use error_estimate')
    guides = () if problem.sliding is None else (str(problem.sliding),)
    for pattern in (*problem.displacement, *problem.traction, *guides):
        if boundary.inner[boundary.segments(pattern)].any():
            raise ValueError(
                f'{NO_BOUND} for conditions on a line inside a body, as on "{pattern}"'
            )
    for line, force in ((pair.line, pair.force) for pair in pairs):
        loaded = (np.append(force, 0.0)[line.rows] != 0).any(axis=1)
        ends = np.isin(line.rows, [-1, *line.rows[line.faces].ravel()]).all(axis=1)
        if line.contact.primary is None and (loaded & ~line.faces & ~ends).any():
            name = line.contact.secondary
            raise ValueError(
                f'{NO_BOUND} for segments that face an obstacle in part, as on "{name}"'
            )
    for one in features_of(problem, boundary.mesh):
        for x, y, _ in one.jumps.tolist():
            raise ValueError(
                f'the displacement prescribed on "{one.name}" jumps near ({x:.6g}, {y:.6g}): '
                "no displacement of finite energy does; make it continuous, or leave a gap between "
                "boundaries"
            )


def refuse_narrow(problem: Problem, boundary: BoundaryTrace) -> None:
    """Raise where data are narrower than the elements on which the bound looks at them.

    Raises
    ------
    ValueError
        The first function, with place and width.
    """
    for one in unresolved(problem, boundary.mesh, in_bounds=True):
        raise ValueError(f"{NO_BOUND} where {one}; refine the mesh there")
