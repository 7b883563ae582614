"""Problems for which no bound is known: refused by name, before any work."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...contact import ContactState
from ...fem import BoundaryTrace
from ...problem import Problem
from ...quadrature import features_of, unresolved


def refuse_bound(problem: Problem, boundary: BoundaryTrace, pairs: Sequence[ContactState]) -> None:
    """Raise unless the error of a problem's solutions can be bounded.

    Raises
    ------
    ValueError
        What stands in the way.
    """
    no_bound = "no guaranteed bound is known for"
    names = boundary.mesh.GetBoundaries()
    bent = np.flatnonzero(boundary.curved_segments)
    if boundary.inner[bent].any():
        name = names[boundary.region[bent[boundary.inner[bent]][0]]]
        raise ValueError(f'{no_bound} curved lines inside a body, as "{name}"; use error_estimate')
    axis = boundary.model.on_axis(boundary.curve[:, [0, -1]].reshape(-1, 2))
    at_axis = bent[axis.reshape(-1, 2)[bent].any(axis=1)]
    if at_axis.size:
        name = names[boundary.region[at_axis[0]]]
        raise ValueError(f'{no_bound} curves that meet the axis, as "{name}"; use error_estimate')
    guides = () if problem.sliding is None else (str(problem.sliding),)
    for pattern in (*problem.displacement, *problem.traction, *guides):
        at = boundary.segments(pattern)
        if boundary.inner[at].any():
            raise ValueError(f'{no_bound} conditions on a line inside a body, as on "{pattern}"')
    for pair in pairs:
        line = pair.line
        if line.contact.primary is not None:
            continue
        loaded = (np.append(pair.force, 0.0)[line.rows] != 0).any(axis=1)
        ends = np.isin(line.rows, [-1, *line.rows[line.faces].ravel()]).all(axis=1)
        if (loaded & ~line.faces & ~ends).any():
            raise ValueError(
                f"{no_bound} segments that face an obstacle in part, as on "
                f'"{line.contact.secondary}"'
            )


def refuse_jumps(problem: Problem, boundary: BoundaryTrace) -> None:
    """Raise where a prescribed displacement jumps inside a boundary.

    Raises
    ------
    ValueError
        The first one, with its place.
    """
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
        raise ValueError(f"no guaranteed bound is known where {one}; refine the mesh there")
