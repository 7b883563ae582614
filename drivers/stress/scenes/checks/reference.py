"""An order-1 contact solver of its own: NumPy, SciPy and a solver of quadratic programs.

Straight triangles with nodes on the exact curves. On every side of a secondary the multipliers are
hats in the arc length, the rows their integrals against jump and gap, which are taken along rays
between the exact curves: int phi_j (d.(u - u') - eps) ds <= 0. Displacements on a side are the
interpolants in its arc length. The displacements of the lines of contact are the unknowns of a
dense quadratic program, all others are eliminated.
"""

from __future__ import annotations

from dataclasses import replace

import daqp
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from drivers.stress.scenes.checks.lines import LEAST, Plane, plane, side_rows
from drivers.stress.scenes.checks.measures import Measures, law
from drivers.stress.scenes.posing import netgen_mesh
from drivers.stress.scenes.scene import Pair, Scene
from drivers.stress.scenes.sides import Array, Index

BALANCED = 1e-6  # of the largest force; the tolerance of the quadratic program is 1e-10


def stiffness(m: Plane) -> tuple[sp.csr_array, Array]:
    """Matrix (2n, 2n), unknowns node by node, and weight (2n,)."""
    corner = m.x[m.triangles]
    edge = np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1)  # opposite to each corner
    area = 0.5 * (edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    grad = np.stack([-edge[..., 1], edge[..., 0]], axis=-1) / (2 * area)[:, None, None]
    t = len(area)
    B = np.zeros((t, 3, 6))  # strains xx, yy, 2 xy
    B[:, 0, 0::2] = B[:, 2, 1::2] = grad[..., 0]
    B[:, 1, 1::2] = B[:, 2, 0::2] = grad[..., 1]
    laws = []
    for b in m.scene.bodies:
        lam, mu = law(b, m.scene.model)
        laws.append([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, mu]])
    K = np.einsum("t,tki,tkl,tlj->tij", area, B, np.array(laws)[m.body], B)
    dof = (2 * m.triangles[:, :, None] + np.arange(2)).reshape(t, 6)
    row, column = np.broadcast_arrays(dof[:, :, None], dof[:, None, :])
    n = 2 * len(m.x)
    A = sp.csr_array((K.ravel(), (row.ravel(), column.ravel())), shape=(n, n))
    f = np.zeros(n)
    for k, b in enumerate(m.scene.bodies):
        for c, w in enumerate(m.scene.weight.get(b.name, ())):
            at = m.body == k
            np.add.at(f, 2 * m.triangles[at] + c, (w * area[at] / 3)[:, None])
    return A, f


def tractions(m: Plane) -> Array:
    """Load (2n,) of tractions and pressures, exact for affine ones on straight sides."""
    f = np.zeros(2 * len(m.x))
    g = 0.5 + np.array([-0.5, 0.5]) / 3**0.5
    for name in {*m.scene.pressure, *m.scene.traction}:
        for i, side in enumerate(m.scene.sides[name]):
            v, s = m.nodes[name, i], m.arcs[name, i]
            for t in g:
                at = s[:-1] + t * np.diff(s)
                load = np.zeros((len(at), 2))
                if name in m.scene.pressure:
                    load -= m.scene.pressure[name](side.point(at))[:, None] * side.normal(at)
                load += m.scene.traction.get(name, (0.0, 0.0))
                load *= np.diff(s)[:, None] / 2
                for c in (0, 1):
                    np.add.at(f, 2 * v[:-1] + c, (1 - t) * load[:, c])
                    np.add.at(f, 2 * v[1:] + c, t * load[:, c])
    return f


def supported(m: Plane) -> tuple[sp.csc_array, Array]:
    """Free unknowns and what is prescribed: u = T y + u0, T (2n, r), u0 (2n,)."""
    n = len(m.x)
    conditions: dict[int, list[Array]] = {}
    u0 = np.zeros((n, 2))
    for name, value in m.scene.clamped.items():
        for i, _ in enumerate(m.scene.sides[name]):
            v = m.nodes[name, i]
            u0[v] = value(m.x[v])
            for k in v.tolist():
                conditions[k] = [np.eye(2)[0], np.eye(2)[1]]
    for name in m.scene.sliding:
        for i, side in enumerate(m.scene.sides[name]):
            normals = side.normal(m.arcs[name, i])
            for k, normal in zip(m.nodes[name, i].tolist(), normals, strict=True):
                conditions.setdefault(k, []).append(normal)
    row, column, entry, r = [], [], [], 0
    for k in range(n):
        _, size, basis = np.linalg.svd(np.array([[0.0, 0.0], *conditions.get(k, [])]))
        for free in basis[np.append(size, [0, 0])[:2] < 1e-6]:
            row += [2 * k, 2 * k + 1]
            column += [r, r]
            entry += free.tolist()
            r += 1
    T = sp.csc_array((entry, (row, column)), shape=(2 * n, r))
    return T, u0.ravel()


def contact_rows(m: Plane) -> tuple[sp.csr_array, Array, list[tuple[tuple[str, int], Array]]]:
    """Rows (k, 2n) over their weights, gaps (k,), and each side's arc lengths of its rows.

    Pairs on one side along one direction are one, whose primary is all they name.
    """
    merged: dict[tuple[str, object], Pair] = {}
    for pair in m.scene.pairs:
        for name in pair.secondary:
            before = merged.get((name, pair.direction))
            primary = tuple(dict.fromkeys((*(before.primary if before else ()), *pair.primary)))
            merged[name, pair.direction] = replace(pair, secondary=(name,), primary=primary)
    blocks, gaps, places = [], [], []
    for (name, _), pair in merged.items():
        for i, side in enumerate(m.scene.sides[name]):
            B, g, weight, share = side_rows(m, (name, i), pair, side)
            kept = np.flatnonzero(share > LEAST)
            blocks.append(sp.diags_array(1 / weight[kept]) @ B[kept])
            gaps.append(g[kept] / weight[kept])
            places.append(((name, i), m.arcs[name, i][kept]))
    return sp.vstack(blocks).tocsr(), np.concatenate(gaps), places


def minimised(
    A: sp.csc_array, f: Array, B: sp.csc_array, g: Array, at: Index
) -> tuple[Array, Array]:
    """Minimiser (n,) of y.A y / 2 - f.y where B y <= g, and multipliers (k,).

    The unknowns `at` (r,) hold all bodies, and all that B knows are among them. Raises
    `ArithmeticError` where the solver finds none.
    """
    rest = np.setdiff1d(np.arange(len(f)), at)
    factor = splu(A[rest][:, rest].tocsc())
    across = A[rest][:, at].toarray()
    inner = factor.solve(np.column_stack([across, f[rest]]))
    H = A[at][:, at].toarray() - across.T @ inner[:, :-1]
    h = f[at] - across.T @ inner[:, -1]
    stiff = float(np.abs(np.diag(H)).max())
    size = max(float(np.abs(g).max(initial=0.0)), float(np.abs(h).max()) / stiff)
    H, h, rows = (H + H.T) / (2 * stiff), h / (stiff * size), B[:, at].toarray()
    y, _, flag, info = daqp.solve(
        H, -h, rows, g / size, primal_tol=1e-10, eps_prox=-1e-6, iter_limit=100_000
    )
    force = np.asarray(info["lam"])
    left = H @ y - h + rows.T @ force  # all terms of size 1, forces balance but for them
    if flag != 1 or not np.abs(left).max() <= BALANCED * max(1.0, np.abs(force).max(initial=0.0)):
        raise ArithmeticError(f"the quadratic program ended with {flag}")
    result = np.zeros(len(f))
    result[at] = y * size
    result[rest] = inner[:, -1] - inner[:, :-1] @ result[at]
    return result, force * stiff * size


def reference(scene: Scene, factor: float) -> Measures:
    """Numbers of the order-1 solution on a mesh of `factor` times the sizes of the scene."""
    m = plane(scene, netgen_mesh(scene, factor))
    A, f = stiffness(m)
    f = f + tractions(m)
    T, u0 = supported(m)
    B, g, places = contact_rows(m)
    node = np.unique(B.nonzero()[1]) // 2  # with both components: no body moves while they rest
    at = np.unique(T.tocsr()[[*2 * node, *2 * node + 1]].nonzero()[1])
    K, load = (T.T @ A @ T).tocsc(), T.T @ (f - A @ u0)
    y, force = minimised(K, load, (B @ T).tocsc(), g - B @ u0, at)
    u = T @ y + u0
    own = [
        np.repeat(np.isin(np.arange(len(m.x)), m.triangles[m.body == k]), 2)
        for k in range(len(scene.bodies))
    ]
    work, push = u * (A @ u), -(B.T @ force).reshape(-1, 2)
    stops = np.cumsum([len(s) for _, s in places])
    parts = np.split(force, stops[:-1])
    return Measures(
        norm={b.name: float(work[k].sum()) ** 0.5 for b, k in zip(scene.bodies, own, strict=True)},
        energy=float(work.sum() / 2 - f @ u),
        force={b.name: push[k[::2]].sum(axis=0) for b, k in zip(scene.bodies, own, strict=True)},
        along={key: (s, F) for (key, s), F in zip(places, parts, strict=True)},
        error=0.0,
    )
