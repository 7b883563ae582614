"""Problems for which no bound is known: refused by name, before any work."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...contact import ContactState, divided
from ...fem import BoundaryTrace
from ...problem import Problem
from .data import bent_segments


def refuse_bound(problem: Problem, boundary: BoundaryTrace, pairs: Sequence[ContactState]) -> None:
    """Raise unless the error of a problem's solutions can be bounded.

    Raises
    ------
    ValueError
        What stands in the way.
    """
    no_bound = "no guaranteed bound is known for"
    names = boundary.mesh.GetBoundaries()
    bent = bent_segments(boundary)
    if boundary.inner[bent].any():
        name = names[boundary.region[bent[boundary.inner[bent]][0]]]
        raise ValueError(f'{no_bound} curved lines inside a body, as "{name}"; use error_estimate')
    axis = boundary.model.on_axis(boundary.curve[:, [0, -1]].reshape(-1, 2))
    at_axis = bent[axis.reshape(-1, 2)[bent].any(axis=1)]
    if at_axis.size:
        name = names[boundary.region[at_axis[0]]]
        raise ValueError(f'{no_bound} curves that meet the axis, as "{name}"; use error_estimate')
    guided = bent[boundary.lies_on(bent, None if problem.sliding is None else str(problem.sliding))]
    if guided.size:
        name = names[boundary.region[guided[0]]]
        raise ValueError(f'{no_bound} curved guides, as "{name}"; use error_estimate')
    for pattern in (*problem.displacement, *problem.traction):
        at = boundary.segments(pattern)
        if boundary.inner[at].any():
            raise ValueError(f'{no_bound} conditions on a line inside a body, as on "{pattern}"')
    for pair in pairs:
        if _in_part(pair, boundary):
            raise ValueError(
                f"{no_bound} segments that face the other body in part, as on "
                f'"{pair.line.contact.secondary}"'
            )


def _in_part(pair: ContactState, boundary: BoundaryTrace) -> bool:
    """Whether forces act on segments of which a part faces the other body, a part does not.

    Others, which have but an end in common with the line of contact, touch it at one point.
    """
    line = pair.line
    loaded = (np.append(pair.force, 0.0)[line.rows] != 0).any(axis=1)
    partly = np.flatnonzero(loaded & ~line.faces)
    if line.contact.primary is None:
        known = np.isin(line.rows[partly], [-1, *line.rows[line.faces].ravel()])
        return not known.all()
    return divided(boundary, line.contact, line.segments[partly], line.facing).local.size > 0
