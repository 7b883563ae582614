"""The equilibrated stress of a bound as a user reads it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from .bound import Proof
from .certificate import certificate_arrays
from .elements import among
from .facing import bernstein

INSIDE = 1e-9  # parameters nearer to an end are inside of the part that begins there


@dataclass(frozen=True, eq=False)
class ContactPressure:
    """p* of one pair on k parts of segments.

    Attributes
    ----------
    segments : ndarray of int (k,)
        Segments of the boundary of the mesh, the secondary's.
    span : ndarray (k, 2)
        Parameters s on them at which each part begins and ends.
    coefficients : ndarray (k, d + 1)
        Of Bernstein polynomials from the beginning to the end, units of stress; per unit length
        (P1), per unit eta (P2).
    """

    segments: Index
    span: Array
    coefficients: Array

    def values(self, segment: Index, s: Array) -> Array:
        """p* (k,) at `s` (k,) of segments `segment` (k,), 0 where it does not act.

        At the end of two parts the one towards the middle of the segment.
        """
        low, high = np.sort(self.span, axis=1).T
        order = np.argsort(self.segments + low)
        inside = np.clip(s, INSIDE, 1 - INSIDE)
        at = np.searchsorted((self.segments + low)[order], segment + inside, side="right") - 1
        part = order[np.maximum(at, 0)] if len(order) else np.zeros(len(segment), dtype=np.intp)
        on = np.flatnonzero((at >= 0) & (segment == np.append(self.segments, -1)[part]))
        on = on[inside[on] <= high[part[on]]]
        a, b = self.span[part[on]].T
        basis = bernstein(self.coefficients.shape[1] - 1, (s[on] - a) / (b - a))
        found = np.zeros(len(segment))
        found[on] = (basis * self.coefficients[part[on]]).sum(axis=1)
        return found


@dataclass(frozen=True, eq=False)
class EquilibratedStress:
    """A stress in equilibrium with the loads on n triangles.

    Attributes
    ----------
    proof : Proof
        What it was made of.
    """

    proof: Proof

    @property
    def degree(self) -> int:
        """Of its polynomials on triangles with straight sides; about an axis of r times it."""
        return min(e.degree for e in self.proof.elements)

    @property
    def triangles(self) -> Array:
        """Corners (n, 3, 2) of the triangles, lengths."""
        return self.proof.cells.corners

    @property
    def element(self) -> Index:
        """Elements (n,) of the mesh that they are, or parts of."""
        return self.proof.cells.parent

    @property
    def pressure(self) -> list[ContactPressure]:
        """p* of each pair."""
        cells, found = self.proof.cells, []
        for line, p in zip(self.proof.program.lines, self.proof.stress.pressure, strict=True):
            if line.pair is not None:
                side = line.side
                found.append(ContactPressure(cells.segment[side], cells.span[side], p))
        return found

    @property
    def certificate(self) -> dict[str, float]:
        """Largest residual of equilibrium, relative to the largest stress; the least p*, a stress.

        The divergence holds by construction; what is left are jumps of tractions between triangles
        and from the given ones.
        """
        lines = zip(self.proof.program.lines, self.proof.stress.pressure, strict=True)
        least = [p.min(initial=0.0) for line, p in lines if not line.equality]
        return {
            "tractions": self.proof.stress.residual,
            "least pressure": float(min(least, default=0.0)),
        }

    def values(self, element: Index, reference: Array) -> Array:
        """Stress (k, 3) as (xx, yy, xy), or (k, 4) as (rr, zz, hoop, rz), units of stress.

        Parameters
        ----------
        element : ndarray of int (k,)
            Elements of the mesh.
        reference : ndarray (k, 2)
            Places in them, NGSolve's reference coordinates.
        """
        proof, cells = self.proof, self.proof.cells
        first = np.argsort(cells.parent, kind="stable")
        count = np.bincount(cells.parent, minlength=int(element.max(initial=0)) + 1)
        start, many = (np.cumsum(count) - count)[element], count[element]
        x = cells.evaluate(ng.CF((ng.x, ng.y)), first[start], reference)
        # Of the parts of an element the one that a place lies in, or is the nearest to.
        last, at = np.cumsum(many), np.repeat(np.arange(len(element)), many)
        part = first[np.arange(len(at)) + np.repeat(start - last + many, many)]
        corners = cells.corners[part]
        edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        share = np.linalg.solve(edges, (x[at] - corners[:, 0])[..., None])[..., 0]
        inside = np.minimum(share.min(axis=1), 1 - share.sum(axis=1))
        own = part[np.lexsort((-np.arange(len(at)), inside, at))[last - 1]]
        found = np.empty((len(element), proof.elements[0].strain.shape[2]))
        for e, c, at, some in among(proof.elements, proof.stress.coefficients, own):
            found[at] = e.stress(c, x[at, None], some)[:, 0]
            if found.shape[1] > 3:
                found[at, 2] += e.radial_at(cells, own[at], reference[at])
        return found

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write `path` (.npz): arrays that drivers/check_certificate.py checks with NumPy alone.

        Raises
        ------
        ValueError
            Another suffix, or a stress on curved triangles, of which there is no certificate.
        """
        path = Path(path)
        if path.suffix != ".npz":
            raise ValueError(f'path="{path}" must end in .npz')
        arrays: dict[str, Any] = dict(certificate_arrays(self.proof))
        np.savez_compressed(path, **arrays)
        return path
