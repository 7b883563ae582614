"""Check the certificate of an error bound with NumPy alone: equilibrium, signs, and the bound.

The file is written by `Solution.equilibrated.save`. Nothing of the package or of NGSolve is used.
The stress is interpolated from its values at lattice points of each triangle, so it is a
polynomial in x, on curved triangles, too. Checked are that its divergence balances the body force,
that tractions are continuous between triangles and as given on straight edges of the boundary, that
on curves and on Gamma_K what is missed of them is orthogonal to rigid motions and as small as the
norms of `curves` say, that p* >= 0 acts on both bodies alike, that the gap is open, and that B
follows from the arrays. Triangles that are curved, or of laws that vary, have maps (polynomials),
laws and discrete stresses at points of a quadrature, of which the order is checked. Of a body of
revolution the polynomials are T = 2 pi r s: the axial equation is checked, the hoop stress is what
the radial one says of T. Taken as told are the problem's data, the discrete stress, the gap, and
the norms of the lifting and of loads that no polynomial meets.

    python -m drivers.check_certificate certificate.npz
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

TOLERANCE = 1e-9  # relative, of sums of round-off; measured 1e-15 to 1e-12
# Of what must not be negative, relative to the largest: 45 units of round-off, for a zero that is a
# sum of some ten products, such as a circumference on the axis (measured 1e-20, with other kernels
# 0). It changes a term of B^2 by 1e-14 of its size, of which `TOLERANCE` lets pass 1e-9.
SIGN = 1e-14
ROUND_OFF = 1e-12  # of norms, relative to the discrete stress
COVERED = 1e-6  # share of an edge of the boundary that may be without tractions asked for
STRAIGHT = 1e-12  # distance of a curve from its chord, relative, up to which it is straight
MIDDLES = 12  # degree of the lattice on which the best balls of Korn's constant are sought
PLACES = 17  # on each edge, at which shapes of curved triangles are looked at
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


class Shapes:
    """Triangles, some of them images of the reference triangle under polynomials."""

    def __init__(self, arrays: Arrays) -> None:
        self.a = a = arrays
        x = a["vertices"][a["triangles"]]
        self.sides = np.stack([x[:, 0] - x[:, 2], x[:, 1] - x[:, 2]], axis=2)
        self.area = np.linalg.det(self.sides) / 2
        self.inverse = np.linalg.inv(self.sides)
        hats = np.concatenate([self.inverse, -self.inverse.sum(axis=1, keepdims=True)], axis=1)
        size = np.linalg.norm(hats, axis=2)
        self.normals, self.lengths = -hats / size[:, :, None], 2 * self.area[:, None] * size
        self.sampled = a.get("sampled_triangle", np.zeros(0, dtype=int))
        self.number = np.full(len(x), -1)
        self.number[self.sampled] = np.arange(len(self.sampled))
        if self.sampled.size:
            self.fit = np.linalg.inv(powers(int(a["sampled_degree"]), a["sampled_lattice"])[0])

    def places(self, triangle: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, q, 2) and Jacobians (n, q, 2, 2) at reference points `at` (n, q, 2)."""
        x = self.a["vertices"][self.a["triangles"][triangle, 2]][:, None]
        x = x + np.einsum("nij,nqj->nqi", self.sides[triangle], at)
        jacobian = np.tile(self.sides[triangle][:, None], (1, at.shape[1], 1, 1))
        mine = np.flatnonzero(self.number[triangle] >= 0)
        if mine.size:
            maps = self.fit @ self.a["sampled_map"][self.number[triangle[mine]]]
            found = powers(int(self.a["sampled_degree"]), at[mine].reshape(-1, 2))
            value, du, dv = (v.reshape(*at[mine].shape[:2], -1) @ maps for v in found)
            x[mine], jacobian[mine] = value, np.stack([du, dv], axis=3)
        return x, jacobian

    def straight(self, triangle: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Reference points (n, q, 2) of which places `x` are the affine images."""
        origin = self.a["vertices"][self.a["triangles"][triangle, 2]][:, None]
        return np.einsum("nij,nqj->nqi", self.inverse[triangle], x - origin)

    def along(
        self, triangle: np.ndarray, side: np.ndarray, t: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, q, 2) on edges, and outward normals times ds over the chord and dt."""
        x, jacobian = self.places(triangle, edge_points(side, t))
        way = edge_points(side, np.tile([0.0, 1.0], (len(side), 1)))
        dx = np.einsum("nqij,nj->nqi", jacobian, way[:, 1] - way[:, 0])
        chord = self.lengths[triangle, side][:, None, None]
        return x, np.stack([dx[..., 1], -dx[..., 0]], axis=2) / chord

    @cached_property
    def bends(self) -> np.ndarray:
        """Distances (n, 3) of the edges from straight, evenly run ones, over their lengths."""
        bends = np.zeros_like(self.lengths)
        t = np.tile(np.linspace(0, 1, PLACES), (len(self.sampled), 1))
        for side in range(3):
            at = edge_points(np.full(len(self.sampled), side), t)
            flat = self.straight(self.sampled, self.places(self.sampled, at)[0]) - at
            off = np.einsum("nij,nqj->nqi", self.sides[self.sampled], flat)
            bends[self.sampled, side] = np.linalg.norm(off, axis=2).max(axis=1, initial=0.0)
        return bends / self.lengths

    def constants(self, triangle: int, D: np.ndarray) -> tuple[float, np.ndarray]:
        """Korn's constant, and squares (3,) of those of traces; `D` (q, 2, 2) by places.

        docs/bounds.md has the inequalities.
        """
        at = np.full(3, triangle)
        x, normal = self.along(at, np.arange(3), np.tile(np.linspace(0, 1, PLACES), (3, 1)))
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        corners, lengths = self.a["vertices"][self.a["triangles"][triangle]], self.lengths[triangle]
        shares = [lengths / lengths.sum()]
        shares += [
            np.array([i, j, MIDDLES - i - j]) / MIDDLES
            for i in range(1, MIDDLES)
            for j in range(1, MIDDLES - i)
        ]
        tried = np.array(shares) @ corners
        away = x - tried[:, None, None]
        rho = (away * normal).sum(axis=3).min(axis=(1, 2))
        ratios = rho / np.linalg.norm(away, axis=3).max(axis=(1, 2))
        ratio, middle = ratios.max(), tried[ratios.argmax()]
        beta = ratio / math.sqrt(2) / math.sqrt(1 + math.sqrt(1 - ratio**2))
        det = np.linalg.det(D)
        distortion = np.linalg.norm(D, ord=2, axis=(1, 2)).max() * math.sqrt(det.max() / det.min())
        poincare = lengths.max() / math.pi * distortion
        several = (self.bends[triangle] > STRAIGHT).sum() > 1
        away = x - (middle if several else corners[:, None])
        least = (away * normal).sum(axis=2).min(axis=1)
        far = np.linalg.norm(away, axis=2).max(axis=1)
        return math.sqrt(1 + 2 / beta**2), 2 * (poincare**2 + far * poincare) / least


class Certificate:
    """The arrays, and what follows from them."""

    equations = slice(0, 2)  # components of the divergence that the file's force balances

    def __init__(self, arrays: Arrays) -> None:
        self.a = arrays
        self.k = int(arrays["degree"])
        self.shapes = shapes = Shapes(arrays)
        self.area, self.normals, self.lengths = shapes.area, shapes.normals, shapes.lengths
        self.inverse = np.linalg.inv(powers(self.k, arrays["lattice"])[0])
        self.stress = np.einsum("iq,nqc->nci", self.inverse, arrays["stress"])
        self.largest = max(np.abs(arrays["stress"]).max(), np.finfo(float).tiny)

    def stress_at(self, triangle: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Stresses (n, q, 3) at places `x` (n, q, 2)."""
        at = self.shapes.straight(triangle, x)
        values = powers(self.k, at.reshape(-1, 2))[0].reshape(*x.shape[:2], len(self.inverse))
        return np.einsum("nqi,nci->nqc", values, self.stress[triangle])

    def divergence(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Divergences (n, q, 2) at straight reference `points` (q, 2) or (n, q, 2)."""
        d = np.stack(powers(self.k, points.reshape(-1, 2))[1:])
        d = d.reshape(2, *points.shape[:-1], -1) if points.ndim == 3 else d[:, None]
        d = np.broadcast_to(d, (2, len(triangle), *d.shape[2:]))
        inverse = self.shapes.inverse[triangle]
        slope = np.einsum("nrx,rnqi,nci->nqcx", inverse, d, self.stress[triangle], optimize=True)
        return np.stack(
            [slope[..., 0, 0] + slope[..., 2, 1], slope[..., 2, 0] + slope[..., 1, 1]], 2
        )

    def traction(self, triangle: np.ndarray, side: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Tractions (n, q, 2) per chord at places t (n, q) of edges."""
        x, n = self.shapes.along(triangle, side, t)
        s = self.stress_at(triangle, x)
        return np.stack(
            [
                n[..., 0] * s[..., 0] + n[..., 1] * s[..., 2],
                n[..., 0] * s[..., 2] + n[..., 1] * s[..., 1],
            ],
            axis=2,
        )

    def checks(self) -> Iterator[tuple[str, float]]:
        """Name of each check, and by how much it fails; at most `TOLERANCE` if it holds."""
        a = self.a
        finite = all(np.isfinite(v).all() for v in a.values())
        yield "all numbers are finite", 0.0 if finite else math.inf
        yield "triangles are oriented", 0.0 if (self.area > 0).all() else math.inf
        worst = 0.0
        for C in (a[name] for name in a if name.endswith("law")):
            skew = np.abs(C - np.swapaxes(C, -1, -2)).max() / np.abs(C).max()
            worst = max(worst, float(skew) if (np.linalg.eigvalsh(C) > 0).all() else math.inf)
        yield "laws are symmetric and definite", worst
        every = np.arange(len(a["triangles"]))
        rest = (self.divergence(every, a["lattice"]) + a["force"])[..., self.equations]
        h = self.lengths.max(axis=1)[:, None, None]
        yield "div s + F = 0", np.abs(h * rest).max() / self.largest
        if self.shapes.sampled.size:
            yield from self.sampled_checks()
        yield from self.edge_checks()
        if "strip_triangle" in a:
            yield from self.strip_checks()
        if "contact_pair" in a:
            yield from self.contact_checks()
        norms = ("loads", "curves", "lifting", "bound")
        largest = max(np.abs(a[name]).max() for name in norms)
        yield "norms are not negative", max(negative(a[name], largest) for name in norms)
        off = max(abs(self.bound() - float(a["bound"])) - self.noise(), 0.0)
        yield "B follows", off / max(float(a["bound"]), np.finfo(float).tiny)

    def noise(self) -> float:
        """Round-off of norms."""
        return ROUND_OFF * math.sqrt((self.norms(equilibrated=False) ** 2).sum())

    def sampled_checks(self) -> Iterator[tuple[str, float]]:
        """Maps, and the quadrature on them."""
        yield from self.map_checks()
        yield "quadrature is exact for polynomials", self.inexact("sampled")
        _, jacobian = self.sampled_places()
        yield "maps keep the orientation", 0.0 if (np.linalg.det(jacobian) > 0).all() else math.inf

    def map_checks(self) -> Iterator[tuple[str, float]]:
        """Maps have the vertices of their triangles."""
        a, shapes = self.a, self.shapes
        corners = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
        x, _ = shapes.places(shapes.sampled, np.tile(corners, (len(shapes.sampled), 1, 1)))
        off = np.abs(x - a["vertices"][a["triangles"][shapes.sampled]]).max(axis=(1, 2))
        yield "maps keep vertices", (off / shapes.lengths[shapes.sampled].min(axis=1)).max()

    def inexact(self, name: str) -> float:
        """By how much a quadrature fails to integrate what it should."""
        a = self.a
        order, geometry = int(a["sampled_exact"]), int(a["sampled_degree"])
        enough = order >= 2 * self.k * geometry + 2 * (geometry - 1)
        u, v = a[f"{name}_points"].T
        i, j = np.array([(d - j, j) for d in range(order + 1) for j in range(d + 1)]).T
        exact = [
            2 / math.comb(m + n, n) / ((m + n + 1) * (m + n + 2)) for m, n in zip(i, j, strict=True)
        ]
        off = np.abs(a[f"{name}_weights"] @ (u[:, None] ** i * v[:, None] ** j) - exact).max()
        return float(off) if enough else math.inf

    def sampled_places(self) -> tuple[np.ndarray, np.ndarray]:
        """Places and Jacobians of the sampled triangles at the points of quadrature."""
        points = np.tile(self.a["sampled_points"], (len(self.shapes.sampled), 1, 1))
        return self.shapes.places(self.shapes.sampled, points)

    def edge_checks(self) -> Iterator[tuple[str, float]]:
        """Continuity inside, and what is given on straight edges of the boundary."""
        a, t = self.a, self.a["edge_points"]
        ends = np.stack([np.roll(a["triangles"], -1, 1), np.roll(a["triangles"], -2, 1)], axis=2)
        keys = np.sort(ends.reshape(-1, 2), axis=1) @ np.array([len(a["vertices"]), 1])
        _, number, count = np.unique(keys, return_inverse=True, return_counts=True)
        outer = np.flatnonzero(count[number] == 1)
        listed = 3 * a["edge_triangle"] + a["edge_side"]
        yield "the boundary is complete", float(not np.array_equal(outer, np.sort(listed)))
        others = self.strip_edges()
        yield "strips lie on the boundary", float(not np.isin(others, outer).all())
        inner = np.delete(self.shapes.bends.ravel(), others)
        yield "other edges are straight", inner.max(initial=0.0)
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

    def strip_edges(self) -> np.ndarray:
        """Numbers of the edges on which tractions are asked for at points."""
        a = self.a
        if "strip_triangle" not in a:
            return np.zeros(0, dtype=int)
        return np.unique(3 * a["strip_triangle"] + a["strip_side"])

    def strip_checks(self) -> Iterator[tuple[str, float]]:
        """Tractions on curves and on Gamma_K: what is missed of them, and its norm."""
        a, t, w = self.a, self.a["strip_place"], self.a["strip_weight"]
        triangle, side = a["strip_triangle"], a["strip_side"]
        edges, number = np.unique(3 * triangle + side, return_inverse=True)
        total = np.bincount(number, w.sum(axis=1))
        off = max(np.abs(total - 1).max() - COVERED, 0.0)
        yield "strips cover their edges", max(off, negative(w))
        asked = a["strip_load"].copy()
        p = np.flatnonzero(a["strip_piece"] >= 0)
        if p.size:
            pressure = self.pressure(a["strip_piece"][p, None], a["strip_s"][p])
            asked[p] += pressure[:, :, None] * a["strip_action"][p]
        off = (self.traction(triangle, side, t) - asked) * a["strip_counts"][:, None]
        x, n = self.shapes.along(triangle, side, t)
        middle = a["vertices"][a["triangles"][triangle]].mean(axis=1)[:, None]
        arm = (x - middle) / self.lengths.max(axis=1)[triangle, None, None]
        turn = off[..., 1] * arm[..., 0] - off[..., 0] * arm[..., 1]
        rigid = np.stack([off[..., 0], off[..., 1], turn], axis=2)
        moments = np.zeros((len(edges), 3))
        np.add.at(moments, number, (w[:, :, None] * rigid).sum(axis=1))
        yield "what is missed has no resultants", np.abs(moments).max() / self.largest
        square = (w * (off**2).sum(axis=2) / np.linalg.norm(n, axis=2)).sum(axis=1)
        chord = self.lengths.ravel()[edges]
        missed = np.sqrt(chord * np.bincount(number, square))
        missed = np.maximum(missed - ROUND_OFF * np.sqrt(chord) * self.largest, 0.0)
        yield "what is missed is bounded", self.shortfall(edges, missed)

    def shortfall(self, edges: np.ndarray, missed: np.ndarray) -> float:
        """By how much, relative, `curves` falls short of constants times `missed` (e,)."""
        a = self.a
        owner, side = np.divmod(edges, 3)
        worst = 0.0
        mandel = np.sqrt([1.0] * (a["law"].shape[1] - 1) + [2.0])
        for triangle in np.unique(owner[missed > 0]):
            mine = owner == triangle
            law, D = self.law_and_map(triangle)
            least = np.linalg.eigvalsh(law * mandel[:, None] * mandel)[..., 0].min()
            least *= self.least_measure(triangle)
            if least <= 0:
                return math.inf
            korn, trace = self.shapes.constants(triangle, D)
            needed = korn * (np.sqrt(trace[side[mine]]) * missed[mine]).sum() / math.sqrt(least)
            if needed > 0:
                worst = max(worst, 1 - a["curves"][triangle] / needed)
        return worst

    def law_and_map(self, triangle: int) -> tuple[np.ndarray, np.ndarray]:
        """Moduli, and Jacobians (q, 2, 2) of the map from the straight triangle."""
        number = self.shapes.number[triangle]
        if number < 0:
            return self.a["law"][triangle], np.eye(2)[None]
        jacobian = self.sampled_places()[1][number]
        return self.a["sampled_law"][number], jacobian @ self.shapes.inverse[triangle]

    def least_measure(self, triangle: int) -> float:
        """What a place in a triangle counts for at least."""
        return 1.0

    def contact_checks(self) -> Iterator[tuple[str, float]]:
        """Signs of p* and of the gap; what p* does to both bodies."""
        a, p = self.a, self.a["contact_pressure"]
        one_sided = a["contact_unilateral"]
        yield "p* >= 0", negative(p[one_sided], self.largest)
        yield "gaps are open", negative(a["gap_open"])
        piece = a["strip_piece"]
        acting = self.lengths[a["strip_triangle"], a["strip_side"]][:, None] * a["strip_weight"]
        acting = acting[:, :, None] * a["strip_action"]
        order = np.argsort(piece, kind="stable")
        order = order[piece[order] >= 0]
        first = np.searchsorted(piece[order], np.arange(len(p)))
        count = np.bincount(piece[order], minlength=len(p))
        whole = np.array_equal(count, np.where(a["contact_obstacle"], 1, 2))
        yield "pieces act on all bodies", 0.0 if whole else math.inf
        if not whole:
            return
        both = ~a["contact_obstacle"]
        one, other = order[first[both]], order[first[both] + 1]
        largest = np.abs(acting).max(axis=(1, 2))
        off = np.abs(acting[one] + acting[other]).max(axis=(1, 2)) / largest[one]
        yield "actions are opposite", off.max(initial=0.0)
        same = np.abs(a["strip_s"][one] - a["strip_s"][other]).max(initial=0.0)
        yield "they are of the same places", same
        total = np.bincount(a["gap_piece"], a["gap_weight"], minlength=len(p))
        size = np.linalg.norm(acting[order[first]], axis=2).sum(axis=1)
        off = np.abs(total / size - 1).max()
        yield "weights cover the zone", max(off, negative(a["gap_weight"]))

    def pressure(self, piece: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The pressure p* of contact pieces at parameters t of their segments."""
        p = self.a["contact_pressure"][piece]
        k = p.shape[-1] - 1
        i = np.arange(k + 1)
        binomial = np.array([math.comb(k, j) for j in i])
        return np.asarray(
            (p * binomial * t[..., None] ** i * (1 - t[..., None]) ** (k - i)).sum(-1)
        )

    def norms(self, equilibrated: bool = True) -> np.ndarray:
        """Energy norms (n,) of s - sigma_h; of sigma_h alone if not `equilibrated`."""
        a, share = self.a, 1.0 if equilibrated else 0.0
        s, w = np.polynomial.legendre.leggauss(self.k + 2)
        s, w = (1 + s) / 2, w / 2
        u, v = (g.ravel() for g in np.meshgrid(s, s, indexing="ij"))
        points = np.column_stack([(1 - v) * u, (1 - v) * (1 - u)])
        weight = 2 * np.outer(w, w).ravel() * (1 - v)
        off = share * a["stress"] - a["discrete_stress"]
        off = np.einsum("qi,nic->nqc", powers(self.k, points)[0] @ self.inverse, off)
        norms = energy_norms(self.area[:, None] * weight, off, a["law"][:, None])
        if self.shapes.sampled.size:
            x, jacobian = self.sampled_places()
            off = share * self.stress_at(self.shapes.sampled, x) - a["sampled_stress"]
            weight = a["sampled_weights"] * np.linalg.det(jacobian) / 2
            norms[self.shapes.sampled] = energy_norms(weight, off, a["sampled_law"])
        return norms

    def bound(self) -> float:
        """B from the arrays."""
        a = self.a
        square = ((self.norms() + a["loads"] + a["curves"]) ** 2).sum() + (a["lifting"] ** 2).sum()
        if "gap_open" in a:
            p = self.pressure(a["gap_piece"], a["gap_s"])
            work = a["gap_weight"] * p * a["gap_open"]
            one_sided = a["contact_unilateral"][a["gap_piece"]]
            square += 2 * np.where(one_sided, np.maximum(work, 0.0), work).sum()
        return math.sqrt(square)


class Revolved(Certificate):
    """The same of a body of revolution: polynomials T = 2 pi r s, all triangles in points.

    2 pi s_hoop is the radial part of div T + 2 pi r F, whatever T is; the axial one is 0.
    """

    equations = slice(1, 2)

    def __init__(self, arrays: Arrays) -> None:
        super().__init__(arrays)
        r = arrays["vertices"][arrays["triangles"], 0]
        self.on_axis = np.abs(r) <= STRAIGHT * np.abs(arrays["vertices"]).max()
        self.rules = [f"rule{i}" for i in range(len(arrays)) if f"rule{i}_triangle" in arrays]

    def places(self, rule: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Triangles (r,) of a rule, places (r, q, 2) and Jacobians there."""
        at = self.a[f"{rule}_triangle"]
        return at, *self.shapes.places(at, np.tile(self.a[f"{rule}_points"], (len(at), 1, 1)))

    def sampled_checks(self) -> Iterator[tuple[str, float]]:
        """Radii, stresses on the axis, maps, and the quadratures on them."""
        a = self.a
        r = a["vertices"][:, 0]
        yield "radii are not negative", max(-r.min() / np.abs(a["vertices"]).max(), 0.0)
        triangle, corner = np.nonzero(~self.on_axis & (self.on_axis.sum(axis=1) == 2)[:, None])
        t = np.tile(np.linspace(0, 1, PLACES), (len(triangle), 1))
        s = self.stress_at(triangle, self.shapes.along(triangle, corner, t)[0])
        yield "r s vanishes on the axis", np.abs(s).max(initial=0.0) / self.largest
        yield from self.map_checks()
        yield "quadrature is exact for polynomials", max(map(self.inexact, self.rules))
        maps = [self.places(rule)[1:] for rule in self.rules]
        inside = all((np.linalg.det(D) > 0).all() and (x[..., 0] > 0).all() for x, D in maps)
        yield "maps keep orientation and side", 0.0 if inside else math.inf
        known = np.sort(np.concatenate([a[f"{rule}_triangle"] for rule in self.rules]))
        whole = np.array_equal(known, np.arange(len(a["triangles"])))
        yield "all triangles are integrated", 0.0 if whole else math.inf

    def law_and_map(self, triangle: int) -> tuple[np.ndarray, np.ndarray]:
        """Moduli, and Jacobians (q, 2, 2) of the map from the straight triangle."""
        for rule in self.rules:
            at, _, jacobian = self.places(rule)
            for number in np.flatnonzero(at == triangle):
                D = jacobian[number] @ self.shapes.inverse[triangle]
                return self.a[f"{rule}_law"][number], D
        raise ValueError(f"triangle {triangle} is in no rule")

    def least_measure(self, triangle: int) -> float:
        """The least circumference on the edges of a triangle."""
        at, t = np.full(3, triangle), np.tile(np.linspace(0, 1, PLACES), (3, 1))
        return float(2 * math.pi * self.shapes.along(at, np.arange(3), t)[0][..., 0].min())

    def norms(self, equilibrated: bool = True) -> np.ndarray:
        """Energy norms (n,) of s - sigma_h over the body, with hoop stresses."""
        a, norms = self.a, np.zeros(len(self.area))
        for rule in self.rules:
            at, x, jacobian = self.places(rule)
            r = x[..., 0]
            off = -a[f"{rule}_stress"]
            if equilibrated:
                T = self.stress_at(at, x) / (2 * math.pi * r[..., None])
                radial = self.divergence(at, self.shapes.straight(at, x))[..., 0]
                hoop = radial / (2 * math.pi) + r * a[f"{rule}_radial"]
                off = off + np.stack([T[..., 0], T[..., 1], hoop, T[..., 2]], axis=2)
            weight = a[f"{rule}_weights"] * np.linalg.det(jacobian) / 2 * 2 * math.pi * r
            norms[at] = energy_norms(weight, off, a[f"{rule}_law"])
        return norms


def negative(x: np.ndarray, largest: float | None = None) -> float:
    """By how much the least of `x` is below 0, as share of the largest of its size.

    In units of `SIGN / TOLERANCE`. What is 0 in exact arithmetic, such as a circumference on the
    axis, is round-off of either sign; where that is, B takes it for 0.
    """
    size = np.abs(x).max(initial=0.0) if largest is None else largest
    least = float(np.minimum(x, 0.0).min(initial=0.0))
    return 0.0 if least == 0 else -least / size * (TOLERANCE / SIGN)


def energy_norms(weight: np.ndarray, s: np.ndarray, law: np.ndarray) -> np.ndarray:
    """Norms (n,) of stresses (n, q, v) with weights (n, q) and laws (n, q, v, v)."""
    solved = np.linalg.solve(law, s[..., None])[..., 0]
    return np.asarray(np.sqrt(np.einsum("nq,nqc,nqc->n", weight, s, solved)))


def check(path: str | Path) -> bool:
    """Print every check of a file, and whether all hold."""
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    certificate = (Revolved if "rule0_triangle" in arrays else Certificate)(arrays)
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
