"""The connected bodies of a mesh: their names, places and sizes, and what belongs to each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index
from ..problem import body_of_vertex
from .boundary import BoundaryTrace
from .space import Space


@dataclass(frozen=True, eq=False)
class Bodies:
    """The connected bodies, b of them.

    Attributes
    ----------
    names : list of str
        The material region of each.
    middle : ndarray (b, 2)
        Of its boundary.
    size : ndarray (b,)
        Half its extent, a length.
    of_segment, of_vertex : ndarray of int (q,), (nv,)
        The body of each segment of the boundary and of each vertex of the mesh.
    """

    names: list[str]
    middle: Array
    size: Array
    of_segment: Index
    of_vertex: Index


def connected_bodies(trace: BoundaryTrace) -> Bodies:
    """The connected pieces of the mesh of `trace`."""
    piece = body_of_vertex(trace.mesh)
    pieces, number = np.unique(piece[trace.nodes[:, 0]], return_inverse=True)
    materials = trace.mesh.GetMaterials()
    names = {int(b): materials[m] for b, m in zip(number, trace.body, strict=True)}
    ends = [trace.curve[number == b].reshape(-1, 2) for b in range(len(names))]
    return Bodies(
        names=[names[b] for b in range(len(names))],
        middle=np.array([(x.min(axis=0) + x.max(axis=0)) / 2 for x in ends]),
        size=np.array([np.ptp(x, axis=0).max() / 2 for x in ends]),
        of_segment=number,
        of_vertex=np.searchsorted(pieces, piece),
    )


def body_of_unknown(space: Space, bodies: Bodies) -> Index:
    """Number of the body that each unknown (2N,) of V_h belongs to."""
    # Vertices come first, so that the first entry of a row is one of an element of its body.
    return bodies.of_vertex[space.A.indices[space.A.indptr[:-1]]]
