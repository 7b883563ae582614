"""An order-1 contact solver of its own: NumPy, SciPy and a solver of quadratic programs.

Straight triangles with nodes on the exact curves. On every side of a secondary the multipliers are
hats in the arc length, the rows their integrals against jump and gap, which are taken along rays
between the exact curves: int phi_j (d.(u - u') - eps) ds <= 0. Displacements on a side are the
interpolants in its arc length. The displacements of the lines of contact are the unknowns of a
dense quadratic program, all others are eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import daqp
import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from drivers.stress.scenes.measures import Measures, law, opposite
from drivers.stress.scenes.posing import netgen_mesh
from drivers.stress.scenes.scene import Array, Index, Pair, Scene, Side

PIECES = 8  # of a segment in integrals along lines, with two Gauss points each
LEAST = 1e-3  # share of a hat that must face the primary for a row
Place = tuple[str, int]
BALANCED = 1e-6  # of the largest force; the tolerance of the quadratic program is 1e-10


@dataclass(frozen=True)
class Plane:
    """A mesh as arrays."""

    scene: Scene
    x: Array  # nodes (n, 2)
    triangles: Index  # (t, 3)
    body: Index  # number (t,) of the body of each triangle
    nodes: dict[Place, Index]  # (k,) of each side, in order
    arcs: dict[Place, Array]  # their arc lengths (k,)


def plane(scene: Scene, mesh: ng.Mesh) -> Plane:
    """Arrays of a straight mesh."""
    x = np.array(mesh.ngmesh.Coordinates())[:, :2]
    faces, ends = mesh.ngmesh.Elements2D().NumPy(), mesh.ngmesh.Elements1D().NumPy()
    names = np.array(mesh.GetBoundaries())[ends["index"].astype(int) - 1]
    segment = ends["nodes"][:, :2].astype(int) - 1
    middle = x[segment].mean(axis=1)
    nodes: dict[Place, Index] = {}
    arcs: dict[Place, Array] = {}
    for name, sides in scene.sides.items():
        at = np.flatnonzero(names == name)
        nearest = np.argmin([side.arc_length(middle[at])[1] for side in sides], axis=0)
        for i, side in enumerate(sides):
            found = np.unique(segment[at[nearest == i]])
            s, _ = side.arc_length(x[found])
            order = np.argsort(s)
            nodes[name, i], arcs[name, i] = found[order], s[order]
    number = {b.name: k for k, b in enumerate(scene.bodies)}
    material = np.array([number[name] for name in mesh.GetMaterials()])
    body = material[faces["index"].astype(int) - 1]
    return Plane(scene, x, faces["nodes"][:, :3].astype(int) - 1, body, nodes, arcs)


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


def pressures(m: Plane) -> Array:
    """Load (2n,) of pressures, exact for affine ones on straight sides."""
    f = np.zeros(2 * len(m.x))
    for name, pressure in m.scene.pressure.items():
        for i, side in enumerate(m.scene.sides[name]):
            v, s = m.nodes[name, i], m.arcs[name, i]
            for t in 0.5 + np.array([-0.5, 0.5]) / 3**0.5:
                at = s[:-1] + t * np.diff(s)
                load = -pressure(side.point(at))[:, None] * side.normal(at)
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


def _hats(s: Array, at: Array) -> tuple[Index, Array]:
    """Numbers (k, 2) and values (k, 2) of the hats on nodes `s` (n,) at arc lengths `at` (k,)."""
    left = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(s) - 2)
    t = (at - s[left]) / (s[left + 1] - s[left])
    return np.column_stack([left, left + 1]), np.column_stack([1 - t, t])


def side_rows(
    m: Plane, key: Place, pair: Pair, side: Side
) -> tuple[sp.csr_array, Array, Array, Array]:
    """Rows (k, 2n), right sides, weights and shares that face (k,) of the hats of one side."""
    s, n = m.arcs[key], len(m.x)
    t = (np.arange(PIECES)[:, None] + 0.5 + np.array([-0.5, 0.5]) / 3**0.5).ravel() / PIECES
    at = (s[:-1, None] + t * np.diff(s)[:, None]).ravel()
    w = np.repeat(np.diff(s) / len(t), len(t))
    x, normal = side.point(at), side.normal(at)
    d = normal if pair.direction is None else np.tile(pair.direction, (len(at), 1))
    cosine = (normal * d).sum(axis=1)
    entries: list[tuple[Index, Index, Array]] = []
    number, phi = _hats(s, at)
    if pair.primary:
        gap, sides, which, there = opposite(m.scene, pair, x, d)
        faces = ~np.isnan(gap) & (cosine > 1e-8)
    else:
        gap, faces = np.zeros(len(at)), np.ones(len(at), dtype=bool)
    if pair.gap is not None:
        gap = pair.gap(x)
    w = np.where(faces, w * cosine, 0.0)  # per eta along a direction
    whole = np.zeros(len(s))
    np.add.at(whole, number, phi * np.repeat(np.diff(s) / len(t), len(t))[:, None])
    weight, g = np.zeros(len(s)), np.zeros(len(s))
    np.add.at(weight, number, phi * w[:, None])
    np.add.at(g, number, phi * (w * np.where(faces, gap, 0.0))[:, None])

    def add(nodes: Index, value: Array, sign: float, on: Index) -> None:
        for a in (0, 1):
            for b in (0, 1):
                for c in (0, 1):
                    v = sign * w[on] * phi[on, a] * value[:, b] * d[on, c]
                    entries.append((number[on, a], 2 * nodes[:, b] + c, v))

    every = np.flatnonzero(faces)
    add(m.nodes[key][number[every]], phi[every], 1.0, every)
    if pair.primary:
        for k, (name, i, _) in enumerate(sides):
            on = np.flatnonzero(faces & (which == k))
            hat, value = _hats(m.arcs[name, i], there[on])
            add(m.nodes[name, i][hat], value, -1.0, on)
    row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    B = sp.csr_array((value, (row, column)), shape=(len(s), 2 * n))
    return B, g, weight, weight / whole


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
    f = f + pressures(m)
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
