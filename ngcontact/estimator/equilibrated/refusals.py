"""Problems for which no bound is known: refused by name, before any work."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...contact import ContactState
from ...fem import BoundaryTrace
from ...problem import Problem, varies

BENT = 1e-12  # distance of a segment from its chord, relative, up to which it is straight


def refuse_bound(problem: Problem, boundary: BoundaryTrace, pairs: Sequence[ContactState]) -> None:
    """Raise unless the error of a problem's solutions can be bounded.

    Raises
    ------
    ValueError
        What stands in the way.
    """
    no_bound = "no guaranteed bound is known for"
    if problem.model not in ("plane strain", "plane stress"):
        raise ValueError(f'{no_bound} the model "{problem.model}"; use error_estimate')
    for body, law in problem.materials.items():
        if varies(law):
            raise ValueError(
                f'{no_bound} moduli that vary, as in body "{body}"; use error_estimate'
            )
    names = boundary.mesh.GetBoundaries()
    curve = boundary.curve
    chord = curve[:, -1] - curve[:, 0]
    off = np.abs(
        (curve[..., 0] - curve[:, :1, 0]) * chord[:, None, 1]
        - (curve[..., 1] - curve[:, :1, 1]) * chord[:, None, 0]
    ).max(axis=1)
    bent = np.flatnonzero(off > BENT * (chord**2).sum(axis=1))
    if bent.size:
        name = names[boundary.region[bent[0]]]
        raise ValueError(f'{no_bound} curved elements, as at "{name}"; use error_estimate')
    for pattern in (*problem.displacement, *problem.traction):
        at = boundary.segments(pattern)
        if boundary.inner[at].any():
            raise ValueError(f'{no_bound} conditions on a line inside a body, as on "{pattern}"')
    for pair in pairs:
        line = pair.line
        name = line.contact.secondary
        if line.means.any():
            raise ValueError(f'{no_bound} dual rows, as on "{name}"; use error_estimate')
        loaded = (np.append(pair.force, 0.0)[line.rows] != 0).any(axis=1)
        ends = np.isin(line.rows, line.rows[line.faces]).all(axis=1)
        if (loaded & ~line.faces & ~ends).any():
            raise ValueError(
                f'{no_bound} segments that face the other body in part, as on "{name}"'
            )
