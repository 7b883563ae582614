"""Check the certificate of an error bound with NumPy alone: equilibrium, signs, and the bound.

The file is written by `Solution.equilibrated.save`. Nothing of the package or of NGSolve is used.
The stress is interpolated from its values at lattice points of each triangle, so it is a
polynomial. Checked are that its divergence balances the body force, that tractions are continuous
between triangles and as given on the boundary, that p* >= 0 is the traction of the secondary, that
the gap is open, and that B follows from the arrays. Taken as told are the problem's data, the
discrete stress, the gap, and the norms of the lifting and of loads that no polynomial meets.

    python -m drivers.check_certificate certificate.npz
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

TOLERANCE = 1e-9  # relative, of sums of round-off; measured 1e-15 to 1e-12
ROUND_OFF = 1e-12  # of B, relative to the energy norm of the discrete stress
Arrays = dict[str, np.ndarray]


def powers(k: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Monomials of degree k at reference points x (q, 2) about the middle, and derivatives."""
    u, v = 3 * (x - 1 / 3).T[:, :, None]
    a, b = np.array([(d - j, j) for d in range(k + 1) for j in range(d + 1)]).T
    du, dv = 3 * a * u ** np.maximum(a - 1, 0) * v**b, 3 * b * u**a * v ** np.maximum(b - 1, 0)
    return u**a * v**b, du, dv


def edge_points(side: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Reference points (n, q, 2) of the edges from corner side + 1 to side + 2."""
    corners = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    first, last = corners[(side + 1) % 3], corners[(side + 2) % 3]
    return first[:, None] + t[..., None] * (last - first)[:, None]


class Certificate:
    """The arrays, and what follows from the triangles."""

    def __init__(self, arrays: Arrays) -> None:
        self.a = arrays
        self.k = int(arrays["degree"])
        x = arrays["vertices"][arrays["triangles"]]
        self.sides = np.stack([x[:, 0] - x[:, 2], x[:, 1] - x[:, 2]], axis=2)
        self.area = np.linalg.det(self.sides) / 2
        inverse = np.linalg.inv(self.sides)
        self.gradients = inverse
        hats = np.concatenate([inverse, -inverse.sum(axis=1, keepdims=True)], axis=1)
        size = np.linalg.norm(hats, axis=2)
        self.normals, self.lengths = -hats / size[:, :, None], 2 * self.area[:, None] * size
        self.inverse = np.linalg.inv(powers(self.k, arrays["lattice"])[0])
        self.stress = np.einsum("iq,nqc->nci", self.inverse, arrays["stress"])
        self.largest = max(np.abs(arrays["stress"]).max(), np.finfo(float).tiny)

    def traction(self, triangle: np.ndarray, side: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Tractions (n, q, 2) at places t (n, q) of edges."""
        x = edge_points(side, t)
        values = powers(self.k, x.reshape(-1, 2))[0].reshape(*t.shape, -1)
        s = np.einsum("nqi,nci->nqc", values, self.stress[triangle])
        nx, ny = self.normals[triangle, side].T[:, :, None]
        return np.stack([nx * s[..., 0] + ny * s[..., 2], nx * s[..., 2] + ny * s[..., 1]], axis=2)

    def checks(self) -> Iterator[tuple[str, float]]:
        """Name of each check, and by how much it fails; at most `TOLERANCE` if it holds."""
        a, n = self.a, len(self.area)
        finite = all(np.isfinite(v).all() for v in a.values())
        yield "all numbers are finite", 0.0 if finite else math.inf
        yield "triangles are oriented", 0.0 if (self.area > 0).all() else math.inf
        skew = np.abs(a["law"] - a["law"].transpose(0, 2, 1)).max() / np.abs(a["law"]).max()
        definite = (np.linalg.eigvalsh(a["law"]) > 0).all()
        yield "laws are symmetric and definite", skew if definite else math.inf
        d = np.stack(powers(self.k, a["lattice"])[1:])
        slope = np.einsum("nrx,rqi,nci->nqcx", self.gradients, d, self.stress, optimize=True)
        div = np.stack(
            [slope[..., 0, 0] + slope[..., 2, 1], slope[..., 2, 0] + slope[..., 1, 1]], 2
        )
        h = self.lengths.max(axis=1)[:, None, None]
        yield "div s + F = 0", np.abs(h * (div + a["force"])).max() / self.largest
        yield from self.edge_checks(n)
        if "contact_pair" in a:
            yield from self.contact_checks()
        signs = (a["loads"] >= 0).all() and (a["lifting"] >= 0).all() and a["bound"] >= 0
        yield "norms are not negative", 0.0 if signs else math.inf
        noise = ROUND_OFF * math.sqrt((self.norms(a["discrete_stress"]) ** 2).sum())
        off = max(abs(self.bound() - float(a["bound"])) - noise, 0.0)
        yield "B follows", off / max(float(a["bound"]), np.finfo(float).tiny)

    def edge_checks(self, n: int) -> Iterator[tuple[str, float]]:
        """Continuity inside, and what is given on the boundary."""
        a, t = self.a, self.a["edge_points"]
        ends = np.stack([np.roll(a["triangles"], -1, 1), np.roll(a["triangles"], -2, 1)], axis=2)
        keys = np.sort(ends.reshape(-1, 2), axis=1) @ np.array([len(a["vertices"]), 1])
        _, number, count = np.unique(keys, return_inverse=True, return_counts=True)
        outer = np.flatnonzero(count[number] == 1)
        listed = 3 * a["edge_triangle"] + a["edge_side"]
        yield "the boundary is complete", float(not np.array_equal(outer, np.sort(listed)))
        order = np.argsort(number, kind="stable")
        order = order[count[number[order]] == 2].reshape(-1, 2)
        yield "edges join two triangles", float(count.max(initial=0) > 2)
        (one, i), (other, j) = (np.divmod(order[:, c], 3) for c in (0, 1))
        here = np.tile(t, (len(one), 1))
        same = ends[one, i, 0] == ends[other, j, 0]
        there = np.where(same[:, None], here, 1 - here)
        jump = self.traction(one, i, here) + self.traction(other, j, there)
        yield "tractions are continuous", np.abs(jump).max(initial=0.0) / self.largest
        own = self.traction(a["edge_triangle"], a["edge_side"], np.tile(t, (len(listed), 1)))
        own = np.einsum("efx,eqx->eqf", a["edge_frame"], own)
        off = np.where(a["edge_constrained"][:, None], own - a["edge_traction"], 0.0)
        yield "tractions are as given", np.abs(off).max() / self.largest

    def contact_checks(self) -> Iterator[tuple[str, float]]:
        """Signs of p* and of the gap; what p* does to both bodies."""
        a, p = self.a, self.a["contact_pressure"]
        one_sided = a["contact_unilateral"]
        yield "p* >= 0", -min(p[one_sided].min(initial=0.0), 0.0) / self.largest * 1e9
        yield "gaps are open", -a["gap_open"].min() * math.inf if a["gap_open"].min() < 0 else 0.0
        total = np.bincount(a["gap_piece"], a["gap_weight"], minlength=len(p))
        edge = 3 * a["contact_triangle"] + a["contact_side"]
        _, first, number = np.unique(edge, return_index=True, return_inverse=True)
        length = self.lengths[a["contact_triangle"], a["contact_side"]] * a["contact_stretch"]
        off = np.abs(np.bincount(number, total) / length[first] - 1).max()
        yield "weights cover the zone", off if (a["gap_weight"] >= 0).all() else math.inf
        d = a["contact_direction"]
        yield "directions are unit vectors", np.abs(np.linalg.norm(d, axis=1) - 1).max()
        t = np.tile(a["edge_points"], (len(p), 1))
        asked = -(self.pressure(np.arange(len(p))[:, None], t) * a["contact_stretch"][:, None])
        own = self.traction(a["contact_triangle"], a["contact_side"], t)
        off = own - asked[:, :, None] * d[:, None]
        yield "p* acts on the secondary", np.abs(off).max() / self.largest

    def pressure(self, piece: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The pressure p* of contact pieces at places t of their edges."""
        p = self.a["contact_pressure"][piece]
        k = p.shape[-1] - 1
        i = np.arange(k + 1)
        binomial = np.array([math.comb(k, j) for j in i])
        return np.asarray(
            (p * binomial * t[..., None] ** i * (1 - t[..., None]) ** (k - i)).sum(-1)
        )

    def norms(self, stress: np.ndarray) -> np.ndarray:
        """Energy norms (n,) of stresses given at the lattice points, (n, m, 3)."""
        s, w = np.polynomial.legendre.leggauss(self.k + 2)
        s, w = (1 + s) / 2, w / 2
        u, v = (g.ravel() for g in np.meshgrid(s, s, indexing="ij"))
        points = np.column_stack([(1 - v) * u, (1 - v) * (1 - u)])
        weight = 2 * np.outer(w, w).ravel() * (1 - v)
        at = np.einsum("qi,nic->nqc", powers(self.k, points)[0] @ self.inverse, stress)
        solved = np.linalg.solve(self.a["law"][:, None], at[..., None])[..., 0]
        return np.sqrt(self.area * np.einsum("q,nqc,nqc->n", weight, at, solved))

    def bound(self) -> float:
        """B from the arrays."""
        a = self.a
        norm = self.norms(a["stress"] - a["discrete_stress"])
        square = ((norm + a["loads"]) ** 2).sum() + (a["lifting"] ** 2).sum()
        if "gap_open" in a:
            p = self.pressure(a["gap_piece"], a["gap_place"])
            square += 2 * (a["gap_weight"] * p * a["gap_open"]).sum()
        return math.sqrt(square)


def check(path: str | Path) -> bool:
    """Print every check of a file, and whether all hold."""
    with np.load(path, allow_pickle=False) as file:
        certificate = Certificate(dict(file))
    good = True
    for name, off in certificate.checks():
        holds = bool(off <= TOLERANCE)  # False for NaN
        good &= holds
        print(f"{'pass' if holds else 'FAIL'}  {name:34s} {off:.1e}")
    print(f"{'pass' if good else 'FAIL'}  |u - u_h| <= {float(certificate.a['bound']):.9g}")
    return good


if __name__ == "__main__":
    results = [check(path) for path in sys.argv[1:]]
    sys.exit(not all(results))
