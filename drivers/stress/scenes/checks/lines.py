"""Rows of the order-1 solver of `reference`: hats on the lines of contact against jump and gap."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from drivers.stress.scenes.checks.balance import opposite
from drivers.stress.scenes.scene import Pair, Scene
from drivers.stress.scenes.sides import Array, Index, Side

PIECES = 8  # of a segment in integrals along lines, with two Gauss points each
LEAST = 1e-3  # share of a hat that must face the primary for a row
Place = tuple[str, int]


@dataclass(frozen=True)
class Plane:
    """A mesh as arrays.

    Attributes
    ----------
    scene : Scene
    x : ndarray (n, 2)
        Nodes.
    triangles : ndarray of int (t, 3)
    body : ndarray of int (t,)
        Number of the body of each triangle.
    nodes, arcs : mapping
        Of each side: its nodes in order (k,), and their arc lengths (k,).
    """

    scene: Scene
    x: Array
    triangles: Index
    body: Index
    nodes: dict[Place, Index]
    arcs: dict[Place, Array]


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
    return Plane(
        scene=scene,
        x=x,
        triangles=faces["nodes"][:, :3].astype(int) - 1,
        body=material[faces["index"].astype(int) - 1],
        nodes=nodes,
        arcs=arcs,
    )


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
