"""Arrays from which an equilibrated stress and its bound can be checked without the package."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ....lagrange import gauss
from ..data import basis, lattice, legendre_values
from .boundary import contact_arrays, strip_arrays
from .record import Proof
from .sampled import sampled_arrays


def certificate_arrays(proof: Proof) -> dict[str, Array]:
    """All arrays by name; docs/bounds.md says what they are.

    Each is in units of the data: lengths, stresses (n, 3, m), roots of energies (n,).
    """
    discrete, units, norms = proof.discrete, proof.units, proof.norms
    partition, k, rough = discrete.partition, discrete.degree, discrete.rough
    points = lattice(k)
    values = basis(k).values(points)
    low, force = discrete.stress.shape[2], discrete.force.sum(axis=1)
    sigma = np.einsum("qi,nci->nqc", values[:, :low], discrete.stress)
    if rough is not None:
        force[rough.at], sigma[rough.at] = rough.force, 0.0
    arrays = {
        "degree": np.array(k),
        "vertices": partition.vertices * units.length,
        "triangles": partition.triangles,
        "lattice": points,
        "stress": np.einsum("qi,nci->nqc", values, proof.raw) * units.traction,
        "discrete_stress": sigma * units.stress,
        "force": np.einsum("qi,nci->nqc", values[:, : force.shape[2]], force)
        * (units.traction / units.length),
        "law": discrete.law * units.modulus,
        "loads": norms.loads * units.root,
        "curves": norms.curves * units.root,
        "lifting": norms.lifting * units.root,
        "bound": np.array(proof.bound),
    }
    if rough is not None:
        arrays |= sampled_arrays(proof)
    return arrays | _edges(proof) | strip_arrays(proof) | contact_arrays(proof)


def _edges(proof: Proof) -> dict[str, Array]:
    """The boundary: from vertex i + 1 to i + 2 of its triangle, at Gauss points.

    Nothing is given here on edges with strips.
    """
    discrete, partition = proof.discrete, proof.discrete.partition
    edge = np.flatnonzero(partition.segment >= 0)
    triangle, side = (x[edge] for x in partition.owner)
    s, _ = gauss(2 * discrete.degree)
    t = np.where(partition.flips[triangle, side][:, None], 1 - s, s)
    values = legendre_values(discrete.degree, t.ravel()).reshape(*t.shape, -1)
    others = ~np.isin(edge, np.concatenate([[-1], *(strip.edge for strip in proof.strips)]))
    constrained = proof.conditions.constrained[edge].reshape(len(edge), 2, -1)[:, :, 0]
    constrained &= others[:, None]
    total = proof.given[edge].sum(axis=1).reshape(len(edge), 2, -1) * constrained[:, :, None]
    return {
        "edge_triangle": triangle,
        "edge_side": side,
        "edge_points": s,
        "edge_frame": proof.conditions.frames[edge],
        "edge_constrained": constrained,
        "edge_traction": np.einsum("eqi,efi->eqf", values, total) * proof.units.traction,
    }
