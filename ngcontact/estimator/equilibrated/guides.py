"""Guides along which the direction turns: what the stress exerts there, and the work of that.

On Gamma_0 u.d = 0, and so the traction -q* d does no work, whatever the scalar q* is. What else of
the traction there is, a little shear, enters like loads that no polynomial meets: q* is chosen so
that it is small and has no resultants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ...lagrange import gauss
from .data import Discrete, edge_places, guide_frames
from .liftings import EdgeField
from .pressures import bernstein
from .remainders import Strip, traction_density

RICHER = 2  # degrees of q* above that of the stress: what it misses is small beside the shear
RESISTED = 1e-7  # work of q* on a motion, relative to the largest, from which it can do any


@dataclass(frozen=True, eq=False)
class Reactions:
    """What turning guides, j edges, exert on a body.

    Attributes
    ----------
    coefficients : ndarray (j, d + 1)
        Of q*, Bernstein polynomials along each edge, without a unit.
    strip : Strip
        The tractions -q* d.
    unmet : float
        Largest resultant that is left, relative to the largest stress: round-off.
    """

    coefficients: Array
    strip: Strip
    unmet: float


def reactions_of(discrete: Discrete, stress: tuple[Array, Array], pair: int) -> Reactions | None:
    """q* near to what a stress exerts on all turning guides; None without such guides.

    Parameters
    ----------
    discrete : Discrete
        The data.
    stress : tuple of ndarray (n, 3, m), (n, 3, r)
        Coefficients of the stress, and of its tractions on the edges.
    pair : int
        By which number a certificate calls them.
    """
    curves = discrete.curves
    guides = np.flatnonzero(curves.guided)
    if guides.size == 0:
        return None
    edge = curves.edge[guides]
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    t = np.tile(rule, (len(edge), 1))
    N, stretch = traction_density(discrete, stress, edge, t)
    action = -stretch[:, :, None] * guide_frames(curves, guides, t)[:, :, 0]
    x, _ = edge_places(discrete.partition, edge, curves, t)
    length = discrete.partition.edge_lengths[edge][:, None, None]
    arm = (x - x.mean(axis=1, keepdims=True)) / length
    p = bernstein(discrete.degree + RICHER, rule)
    coefficients = np.stack(
        [_nearest(p, *one, w) for one in zip(N, action, stretch, arm, strict=True)]
    )
    asked = action * (coefficients @ p.T)[:, :, None]
    left = np.einsum("kqic,kqc->ki", w[:, None, None] * _rigid(arm), N - asked)
    largest = max(np.abs(stress[0]).max(initial=0.0), np.finfo(float).tiny)
    strip = Strip(
        edge=edge,
        t=t,
        weight=np.tile(w, (len(edge), 1)),
        asked=asked,
        counts=np.ones((len(edge), 2), dtype=bool),
        action=action,
        pair=pair,
        piece=np.arange(len(edge)),
        s=t,
    )
    return Reactions(coefficients, strip, float(np.abs(left).max() / largest))


def exerted(
    discrete: Discrete,
    stress: tuple[Array, Array],
    strips: list[Strip],
    residuals: dict[str, float],
    pair: int,
) -> Reactions | None:
    """The reactions to a `stress` (n, 3, m), (n, 3, r), which join the strips and the residuals."""
    guides = reactions_of(discrete, stress, pair)
    if guides is not None:
        strips.append(guides.strip)
        residuals["tractions"] = max(residuals["tractions"], guides.unmet)
    return guides


def _rigid(arm: Array) -> Array:
    """Two translations and a rotation (..., 3, 2) at places `arm` (..., 2) from its centre."""
    motions = np.zeros((*arm.shape[:-1], 3, 2))
    motions[..., 0, 0] = motions[..., 1, 1] = 1.0
    motions[..., 2, 0], motions[..., 2, 1] = -arm[..., 1], arm[..., 0]
    return motions


def _nearest(p: Array, N: Array, action: Array, stretch: Array, arm: Array, w: Array) -> Array:
    """Coefficients (m,) of q, in functions `p` (q, m), that leave least of N - q action.

    `N`, `action`, `arm` (q, 2), `stretch` (q,) on one edge. The rest has no resultants, but for
    those of motions on which no q does any work.
    """
    half = np.sqrt(w / stretch)[:, None]
    A = (half[:, :, None] * action[:, :, None] * p[:, None, :]).reshape(-1, p.shape[1])
    b = (half * N).ravel()
    tests = w[:, None, None] * _rigid(arm)
    C = np.einsum("qic,qc,qm->im", tests, action, p)
    turn, size, across = np.linalg.svd(C)
    met = size > RESISTED * size.max()
    wanted = (turn.T @ np.einsum("qic,qc->i", tests, N))[met] / size[met]
    first, free = across[: len(size)][met].T @ wanted, across[met.sum() :].T
    rest = np.linalg.lstsq(A @ free, b - A @ first, rcond=None)[0]
    return np.asarray(first + free @ rest)


def work_of_guides(
    discrete: Discrete, reactions: Reactions | None, fields: Sequence[EdgeField]
) -> float:
    """Work of the tractions -q* d on `fields` on turning guides."""
    if reactions is None:
        return 0.0
    curves, partition, work = discrete.curves, discrete.partition, 0.0
    number = {int(e): i for i, e in enumerate(reactions.strip.edge)}
    for field in fields:
        mine = np.array([number[int(e)] for e in field.edge])
        _, dx = edge_places(partition, field.edge, curves, field.t)
        d = guide_frames(curves, curves.number[field.edge], field.t)[:, :, 0]
        b = reactions.coefficients[mine]
        p = bernstein(b.shape[1] - 1, field.t.ravel()).reshape(*field.t.shape, -1)
        q = np.einsum("kqi,ki->kq", p, b) * np.linalg.norm(dx, axis=2)
        work -= float((field.weight * q * (d * field.value).sum(axis=2)).sum())
    return work
