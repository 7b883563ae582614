"""What round-off leaves between triangles, balanced once more by stresses of a plain norm.

In thin triangles, and where laws are stiff in one direction, tractions are small differences of
large multipliers. What they miss is given to the patches as a load: a sum of stresses that are
least in a norm without a law, in which less cancels, and that are as small as what was missed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ....arrays import Array
from ..data import Discrete, EdgeConditions, with_hats
from .equilibration import Equilibrated, blocks, equilibrated, into_raw


def closed(
    discrete: Discrete, conditions: EdgeConditions, found: Equilibrated, missing: Array
) -> Equilibrated:
    """The same stress without what its tractions miss.

    Parameters
    ----------
    discrete : Discrete
        On n triangles.
    conditions : EdgeConditions
        Of e edges.
    found : Equilibrated
        The stress.
    missing : ndarray (e, r)
        What tractions, summed over the triangles of each edge, have too much.
    """
    e, r = missing.shape
    split = _between_ends(r // 2 - 1)
    given = -np.einsum("hij,efj->ehfi", split, missing.reshape(e, 2, -1)).reshape(e, 2, r)
    plain = _plain(discrete)
    change = equilibrated(plain, conditions, given).change
    if discrete.balance.extent == 0:
        for at in blocks(len(change), change.shape[1] ** 2):
            raw = into_raw(plain, at) @ change[at, :, None]
            change[at] = np.linalg.solve(into_raw(discrete, at), raw)[:, :, 0]
    return replace(found, change=found.change + change)


def _between_ends(degree: int) -> Array:
    """Legendre polynomials (2, k + 1, k + 1) as sums of two, of which each vanishes at one end.

    The hats of the ends times them, but for the last, which a hat would lift beyond the degree: in
    vertices where edges all but cross patches could not carry what does not vanish there.
    """
    split = np.zeros((2, degree + 1, degree + 1))
    split[:, :, :-1] = with_hats(degree)
    split[:, -1, -1] = 0.5
    split[:, -2, -1] = np.array([-0.5, 0.5]) * math.sqrt((2 * degree + 1) / (2 * degree - 1))
    return split


def _plain(discrete: Discrete) -> Discrete:
    """No discrete stress, no loads; about an axis the same norm, in the plane one without a law."""
    n, rough = len(discrete.law), discrete.rough
    unit = np.tile(np.eye(discrete.law.shape[1]), (n, 1, 1))
    if rough is not None:
        into: Array = rough.into
        if discrete.balance.extent == 0:
            size = 1 / np.sqrt(discrete.partition.areas[rough.at])
            into = np.asarray(size[:, None, None] * np.eye(into.shape[1]))
        rough = replace(
            rough,
            into=into,
            hatted=np.zeros_like(rough.hatted),
            divergence=np.zeros_like(rough.divergence),
            force=np.zeros_like(rough.force),
            force_means=np.zeros_like(rough.force_means),
            moments=np.zeros_like(rough.moments),
        )
    return replace(
        discrete,
        order=1,
        law=unit,
        root=unit,
        stress=np.zeros((n, 3, 1)),
        force=np.zeros_like(discrete.force),
        rough=rough,
    )
