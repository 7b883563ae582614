"""Arrays from which a bound can be checked without the package, for cells with straight sides.

On these all that the proof needs is a polynomial in x: the stress times the model's measure
(1, or 2 pi r), the force that it balances, tractions and p* on sides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .bound import Proof
from .facing import THROUGH, WEIGHTS
from .norms import stress_norms
from .polynomials import scalars

INSET = 0.1  # of a step of the lattice: it keeps off an axis, where stresses are not defined
STRAIGHT = 1e-12  # difference of unit vectors that are one: round-off


def certificate_arrays(proof: Proof) -> dict[str, np.ndarray]:
    """All arrays by name: vertices (nv, 2), triangles (n, 3), ...; docs/bounds.md has the list.

    Raises
    ------
    ValueError
        Where cells have curved sides, or normals of drawn curves turn along straight ones.
    """
    cells = proof.cells
    lines = [line.direction for line in proof.program.lines]
    turning = sum(int((np.ptp(d, axis=1) > STRAIGHT).any(axis=1).sum()) for d in lines)
    found = {"cells have a curved side": int(cells.curved.sum())}
    found["sides have a direction of contact or guide that turns along them"] = turning
    if any(found.values()):
        told = " and ".join(f"{n} {what}" for what, n in found.items() if n)
        raise ValueError(f"no certificate: {told}; tractions and p* are no polynomials there")
    own = stress_norms(proof.elements, proof.stress.coefficients, len(cells.triangles)).distance
    replaced = np.flatnonzero(proof.stress.distance != own)
    return {
        "axisymmetric": np.array(cells.trace.model.extent > 0),
        "vertices": cells.vertices,
        "triangles": cells.triangles,
        "replaced": replaced,
        "replaced_distance": proof.stress.distance[replaced],
        "loads": proof.stress.loads,
        "lifting": proof.lifting,
        "bound": np.array(proof.bound),
        **_stresses(proof),
        **_sides(proof),
        **_contact(proof),
    }


def _stresses(proof: Proof) -> dict[str, np.ndarray]:
    """T = measure s and measure F at a lattice; by rules of quadrature e(u_h) and C^-1."""
    cells = proof.cells
    model, corners = cells.trace.model, cells.corners
    k = proof.elements[0].degree
    i, j = np.array([(i, j) for i in range(k + 1) for j in range(k + 1 - i)]).T
    lattice = (np.column_stack([i, j]) + INSET) / (k + 3 * INSET)
    share = np.column_stack([1 - lattice.sum(axis=1), lattice])
    x = np.einsum("qc,ncd->nqd", share, corners)
    measure = model.measure(x.reshape(-1, 2)).reshape(*x.shape[:2], 1)
    stress, force = np.zeros((*x.shape[:2], 3)), np.zeros(x.shape)
    rules: dict[str, np.ndarray] = {}
    for number, (e, c) in enumerate(zip(proof.elements, proof.stress.coefficients, strict=True)):
        at = e.places.at
        stress[at] = e.stress(c, x[at])[..., [0, 1, -1]]
        force[at] = scalars(e.force_degree, e.corners, x[at]) @ e.force
        a, b = e.places.local.T
        rules |= {
            f"rule{number}_triangle": at,
            f"rule{number}_points": np.column_stack([1 - a - b, a]),
            f"rule{number}_weights": e.places.weight[0] / (2 * e.places.weight[0].sum()),
            f"rule{number}_strain": e.strain,
            f"rule{number}_compliance": e.compliance,
            f"rule{number}_radial": e.radial,
        }
    found = {"lattice": lattice, "stress": measure * stress, "force": measure * force}
    return {"degree": np.array(k)} | found | rules


def _sides(proof: Proof) -> dict[str, np.ndarray]:
    """The boundary: vertices, the lower number first, and in Legendre polynomials what is given.

    Tractions are per parameter t of the side and times the measure.
    """
    cells, mu, given = proof.cells, proof.program.multipliers, proof.given
    side = np.flatnonzero(~cells.inner)
    k = int(mu.degree[side[0]])
    dofs = mu.start[side, None] + np.arange(2 * (k + 1))
    traction = proof.moments[dofs].reshape(len(side), 2, k + 1) * np.sqrt(2 * np.arange(k + 1) + 1)
    return {
        "side_vertices": cells.ends[side],
        "side_held": given.held[side],
        "side_traction": traction,
    }


def _contact(proof: Proof) -> dict[str, np.ndarray]:
    """p* and the gap after lifting as Bernstein coefficients, in t of the secondary's sides.

    Sides are numbers among those of the boundary. The primary's parameter is t, or 1 - t where it
    is turned; the weight is linear and given at both ends.
    """
    position = np.full(len(proof.cells.ends) + 1, -1)  # the last one where no side is faced
    boundary = np.flatnonzero(~proof.cells.inner)
    position[boundary] = np.arange(len(boundary))
    faced = proof.program.lines

    def joined(parts: Sequence[np.ndarray], kind: type = float) -> np.ndarray:
        return np.concatenate(parts).astype(kind) if parts else np.zeros(0, kind)

    return {
        "contact_side": joined([position[f.side] for f in faced], int),
        "contact_other": joined([position[f.other] for f in faced], int),
        "contact_turned": joined([f.there[:, -1] < f.there[:, 0] for f in faced], bool),
        "contact_direction": joined([f.direction[:, 0] for f in faced]),
        "contact_weight": joined([f.weight / WEIGHTS @ THROUGH[[0, -1]].T for f in faced]),
        "contact_equality": joined([np.full(len(f.side), f.equality) for f in faced], bool),
        "contact_gap": joined([f.after for f in faced]),
        "contact_pressure": joined(proof.stress.pressure),
    }
