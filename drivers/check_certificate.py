"""Check the certificate of an error bound with NumPy alone: equilibrium, signs, and the bound.

The file is written by `Solution.equilibrated.save`. Nothing of the package or of NGSolve is used.
On each triangle the stress times a measure (1, or 2 pi r about an axis) is the polynomial T of its
values at a lattice. Checked are, as equations between polynomials, that the divergence of T
balances the force; that tractions are continuous, and on the boundary the given ones and those of
p*, which acts on both bodies alike; that p* >= 0 and the gap is open, by Bernstein coefficients;
and that B follows from the arrays. About an axis the radial equation only says what the hoop stress
is. Taken as given are the data, e(u_h), the gap, and norms of w and of what is missed of the data.

    python -m drivers.check_certificate certificate.npz
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.polynomial import legendre

# Of equations between polynomials, relative to the largest stress, and of B. The package lets pass
# 1e-10 in moments, which at a vertex may add up to ten times that; measured 1e-16 to 3e-11.
TOLERANCE = 1e-9
# Of what must not be negative, relative to the largest: 45 units of round-off, for a zero that is a
# sum of some ten products, such as a circumference on the axis. It changes a term of B^2 by 1e-14
# of its size, of which `TOLERANCE` lets pass 1e-9.
SIGN = 1e-14
ROUND_OFF = 1e-12  # of norms, relative to the discrete stress
FACED = 1e-6  # distance of places that face each other, relative to a side: where cuts are one


def powers(total: int) -> tuple[np.ndarray, np.ndarray]:
    """Degrees in both coordinates of all products up to a total degree."""
    i, j = np.array([(d - j, j) for d in range(total + 1) for j in range(d + 1)]).T
    return i, j


def polynomials(k: int, x: np.ndarray) -> np.ndarray:
    """(3, ..., m): products of degree k at x (..., 2) of the unit triangle; by both coordinates."""
    slope = np.zeros((k + 1, k + 1))
    slope[:k] = np.stack([2 * legendre.legder(c) for c in np.eye(k + 1)], axis=1) if k else 0
    (i, j), (u, v) = powers(k), (legendre.legvander(2 * x[..., c] - 1, k) for c in (0, 1))
    du, dv = u @ slope, v @ slope
    return np.stack([u[..., i] * v[..., j], du[..., i] * v[..., j], u[..., i] * dv[..., j]])


def bernstein(c: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values (n, q) of polynomials with coefficients c (n, k + 1) at t (n, q) or (q,)."""
    k = c.shape[1] - 1
    i = np.arange(k + 1)
    values = t[..., None] ** i * (1 - t[..., None]) ** (k - i) * [math.comb(k, j) for j in i]
    return np.asarray((values @ c[:, :, None])[..., 0])


def linear(ends: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values (n, q) of linear functions by those at t = 0 and 1 (n, 2)."""
    return ends[:, :1] + np.diff(ends, axis=1) * t


def turned(x: np.ndarray) -> np.ndarray:
    """Vectors (..., 2) turned clockwise by a right angle."""
    return np.stack([x[..., 1], -x[..., 0]], axis=-1)


class Certificate:
    """The arrays, and what follows from them."""

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self.a = a = arrays
        self.k, self.axial = int(a["degree"]), bool(a["axisymmetric"])
        self.corners = x = a["vertices"][a["triangles"]]
        self.edges = np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=2)
        self.inverse = np.linalg.inv(self.edges)
        self.T = np.linalg.inv(polynomials(self.k, a["lattice"])[0]) @ a["stress"]
        # sides of the triangles, opposite to each corner, by their vertices, the lower number first
        ends = np.stack([np.roll(a["triangles"], -1, 1), np.roll(a["triangles"], -2, 1)], axis=2)
        self.backward = (ends[..., 0] > ends[..., 1]).ravel()
        keys = self.keys(ends.reshape(-1, 2))
        self.side, self.number, self.count = np.unique(
            keys, return_inverse=True, return_counts=True
        )
        self.owner = np.argsort(self.number, kind="stable")  # side by side

    def keys(self, ends: np.ndarray) -> np.ndarray:
        """One number of each pair of vertices (k, 2)."""
        return np.sort(ends, axis=1) @ np.array([len(self.a["vertices"]), 1])

    def at(self, triangle: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T (n, q, 3) and its divergence (n, q, 2) at x (n, q, 2) or (q, 2) of unit triangles."""
        values = polynomials(self.k, x)
        one = "rqi" if x.ndim == 2 else "rnqi"
        T, by_a, by_b = np.einsum(f"{one},nic->rnqc", values, self.T[triangle], optimize=True)
        d = np.stack([by_a, by_b], axis=-1) @ self.inverse[triangle][:, None]
        return T, np.stack([d[..., 0, 0] + d[..., 2, 1], d[..., 2, 0] + d[..., 1, 1]], axis=2)

    def along(self, owner: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T (n, q, 3) on sides of triangles, 3 triangle + side, and T n per t (n, q, 2)."""
        triangle, i = np.divmod(owner, 3)
        start, stop = (i + 1) % 3, (i + 2) % 3
        own = np.where(self.backward[owner, None], 1 - t, t)[..., None]
        unit = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        T, _ = self.at(triangle, (1 - own) * unit[start][:, None] + own * unit[stop][:, None])
        n = turned(self.corners[triangle, stop] - self.corners[triangle, start])[:, None]
        x = n[..., 0] * T[..., 0] + n[..., 1] * T[..., 2]
        return T, np.stack([x, n[..., 0] * T[..., 2] + n[..., 1] * T[..., 1]], axis=2)

    def checks(self) -> Iterator[tuple[str, float]]:
        """Name of each check, and by how much it fails; at most `TOLERANCE` if it holds."""
        a = self.a
        yield "all numbers are finite", fails(all(np.isfinite(v).all() for v in a.values()))
        oriented = (np.linalg.det(self.edges) > 0).all()
        yield "triangles are oriented", fails(oriented)
        if not oriented:
            return
        yield "edges join two triangles", fails(self.count.max() <= 2)
        rest = self.at(np.arange(len(self.T)), a["lattice"])[1] + a["force"]
        size = np.abs(self.edges).max(axis=(1, 2))[:, None, None]
        yield "div s + F = 0", np.abs(size * rest)[..., int(self.axial) :].max() / self.largest
        t = np.linspace(0, 1, self.k + 1)
        twice = self.count[self.number[self.owner]] == 2
        one, other = self.owner[twice].reshape(-1, 2).T
        length = self.lengths(self.side[self.number[one]])[:, None, None]
        jump = (self.along(one, t)[1] + self.along(other, t)[1]) / length
        yield "tractions are continuous", np.abs(jump).max(initial=0.0) / self.largest
        if self.axial:
            yield from self.axis_checks()
        yield from self.rule_checks()
        yield from self.contact_checks()
        yield from self.boundary_checks()
        yield "norms are not negative", max(negative(a["loads"]), negative(a["lifting"]))
        told, size = float(a["bound"]), math.sqrt(self.squares(equilibrated=False).sum())
        off = abs(self.bound() - told) - ROUND_OFF * size
        yield "B follows", max(off, 0.0) / max(told, np.finfo(float).tiny)

    def lengths(self, keys: np.ndarray) -> np.ndarray:
        """Of sides (k,) by their keys."""
        x = self.a["vertices"]
        one, other = np.divmod(keys, len(x))
        return np.linalg.norm(x[one] - x[other], axis=1)

    def axis_checks(self) -> Iterator[tuple[str, float]]:
        """Radii, and T on the axis."""
        r = self.a["vertices"][:, 0]
        yield "radii are not negative", negative(r)
        near = np.abs(r) <= SIGN * np.abs(self.a["vertices"]).max()
        sides = np.stack(np.divmod(self.side, len(r)), axis=1)
        owner = self.owner[np.isin(self.number[self.owner], near[sides].all(axis=1).nonzero()[0])]
        T, _ = self.along(owner, np.linspace(0, 1, self.k + 1))
        yield "r s vanishes on the axis", np.abs(T).max(initial=0.0) / self.largest

    @cached_property
    def rules(self) -> list[tuple[np.ndarray, ...]]:
        """By quadratures: triangles, points, weights, e(u_h), C^-1, r F_r, and the measure."""
        names = ("triangle", "points", "weights", "strain", "compliance", "radial")
        found: list[tuple[np.ndarray, ...]] = []
        while f"rule{len(found)}_triangle" in self.a:
            rule = [self.a[f"rule{len(found)}_{name}"] for name in names]
            r = self.corners[rule[0], :1, 0] + self.edges[rule[0], 0] @ rule[1].T
            found.append((*rule, 2 * math.pi * r if self.axial else np.ones_like(r)))
        return found

    @cached_property
    def largest(self) -> float:
        """Of the components of T and of those of the discrete stress times the measure."""
        found = np.abs(self.a["stress"]).max()
        for *_, strain, D, _, measure in self.rules:
            s = np.linalg.solve(D, strain[..., None])[..., 0]
            found = max(found, np.abs(measure[..., None] * s).max())
        return max(float(found), np.finfo(float).tiny)

    def rule_checks(self) -> Iterator[tuple[str, float]]:
        """Quadratures, and laws."""
        known = np.sort(np.concatenate([rule[0] for rule in self.rules]))
        yield "all triangles are integrated", fails(np.array_equal(known, np.arange(len(self.T))))
        i, j = powers(2 * self.k)
        whole = [
            1 / math.comb(m + n, n) / ((m + n + 1) * (m + n + 2)) for m, n in zip(i, j, strict=True)
        ]
        values = [w @ (x[:, :1] ** i * x[:, 1:] ** j) for _, x, w, *_ in self.rules]
        yield "quadratures are exact for polynomials", np.abs(np.array(values) - whole).max()
        laws = [rule[4] for rule in self.rules]
        yield "laws are definite", fails(all((np.linalg.eigvalsh(D) > 0).all() for D in laws))
        skew = [np.abs(D - np.swapaxes(D, -1, -2)).max() / np.abs(D).max() for D in laws]
        yield "laws are symmetric", max(skew)

    def contact_checks(self) -> Iterator[tuple[str, float]]:
        """Signs of p* and of the gap; that sides face each other along d."""
        a = self.a
        if not len(a["contact_side"]):
            return
        equal = a["contact_equality"]
        yield "p* >= 0", negative(a["contact_pressure"][~equal])
        yield "weights are not negative", negative(a["contact_weight"])
        yield "gaps are open", negative(a["contact_gap"])
        yield "bilateral gaps are closed", fails((a["contact_gap"][equal] == 0).all())
        both = a["contact_other"] >= 0
        ends, d = np.sort(a["side_vertices"], axis=1), a["contact_direction"][both, None]
        own, other = ends[a["contact_side"][both]], ends[a["contact_other"][both]]
        away = a["vertices"][np.where(a["contact_turned"][both, None], other[:, ::-1], other)]
        away, size = away - a["vertices"][own], self.lengths(self.keys(own))[:, None]
        off = np.abs((away * turned(d)).sum(axis=2)) / np.linalg.norm(d, axis=2) / size
        yield "sides face each other along d", off.max(initial=0.0) * TOLERANCE / FACED

    def boundary_checks(self) -> Iterator[tuple[str, float]]:
        """Tractions on the boundary: given ones, and those of p* on both bodies."""
        a = self.a
        key = self.keys(a["side_vertices"])
        complete = np.array_equal(np.sort(key), self.side[self.count == 1])
        yield "the boundary is complete", fails(complete)
        if not complete:
            return
        number = np.searchsorted(self.side, key)
        owner = self.owner[np.searchsorted(self.number[self.owner], number)]
        t = np.linspace(0, 1, max(a["side_traction"].shape[2], a["contact_pressure"].shape[-1] + 1))
        asked = (
            a["side_traction"] @ legendre.legvander(2 * t - 1, a["side_traction"].shape[2] - 1).T
        )
        asked = asked.transpose(0, 2, 1)
        if len(a["contact_side"]):  # per t, which runs backward on sides that are turned
            force = linear(a["contact_weight"], t) * bernstein(a["contact_pressure"], t)
            force = force[..., None] * a["contact_direction"][:, None]
            np.subtract.at(asked, a["contact_side"], force)
            both = a["contact_other"] >= 0
            back = np.where(a["contact_turned"][:, None, None], force[:, ::-1], force)
            np.add.at(asked, a["contact_other"][both], back[both])
        off = (self.along(owner, t)[1] - asked) / self.lengths(key)[:, None, None]
        off = np.abs(np.where(a["side_held"][:, None], 0.0, off)).max(initial=0.0)
        yield "tractions are as given, p* on both", off / self.largest

    def squares(self, equilibrated: bool = True) -> np.ndarray:
        """Squares (n,) of the norms of s - sigma_h; of sigma_h alone if not `equilibrated`."""
        found = np.zeros(len(self.T))
        for at, points, weights, strain, D, radial, measure in self.rules:
            T, divergence = self.at(at, points)
            s = T / measure[..., None]
            if self.axial:
                hoop = divergence[..., 0] / (2 * math.pi) + radial
                s = np.stack([s[..., 0], s[..., 1], hoop, s[..., 2]], axis=2)
            off = equilibrated * (D @ s[..., None])[..., 0] - strain
            density = (off * np.linalg.solve(D, off[..., None])[..., 0]).sum(axis=2)
            area = np.linalg.det(self.edges[at])[:, None] * weights * measure
            found[at] = (area * density).sum(axis=1)
        return found

    def bound(self) -> float:
        """B from the arrays."""
        a = self.a
        square = ((np.sqrt(self.squares()) + a["loads"]) ** 2).sum() + (a["lifting"] ** 2).sum()
        if len(a["contact_side"]):
            p, gap = a["contact_pressure"], a["contact_gap"]
            t, w = np.polynomial.legendre.leggauss((p.shape[1] + gap.shape[1]) // 2 + 1)
            t, w = (1 + t) / 2, w / 2
            parts = linear(a["contact_weight"], t), bernstein(p, t), bernstein(gap, t)
            work = np.prod(parts, axis=0) @ w
            square += 2 * np.where(a["contact_equality"], work, np.maximum(work, 0.0)).sum()
        return math.sqrt(square)


def fails(holds: bool | np.bool_) -> float:
    """What a check that holds or not says."""
    return 0.0 if holds else math.inf


def negative(x: np.ndarray) -> float:
    """By how much the least of `x` is below 0, as share of the largest of its size.

    In units of `SIGN / TOLERANCE`. What is 0 in exact arithmetic, such as a circumference on the
    axis, is round-off of either sign; where that is, B takes it for 0.
    """
    least = float(np.minimum(x, 0.0).min(initial=0.0))
    return 0.0 if least == 0 else -least / np.abs(x).max() * (TOLERANCE / SIGN)


def check(path: str | Path) -> bool:
    """Print every check of a file, and whether all hold."""
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    good = True
    try:
        for name, off in Certificate(arrays).checks():
            holds = bool(off <= TOLERANCE)  # False for NaN
            good &= holds
            print(f"{'pass' if holds else 'FAIL'}  {name:38s} {off:.1e}")
    except (KeyError, IndexError, ValueError) as error:  # with those of linear algebra
        good = False
        print(f"FAIL  arrays do not fit together: {error}")
    print(f"{'pass' if good else 'FAIL'}  |u - u_h| <= {float(arrays.get('bound', math.nan)):.9g}")
    return good


if __name__ == "__main__":
    sys.exit(sum(not check(path) for path in sys.argv[1:]) > 0)
