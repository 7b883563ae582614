"""Contact line of a pair: where nodes do not face nodes, rows are means over facing parts.

On a segment e of the secondary, restricted to its part that faces the primary, let D_e be the
diagonal of the integrals of the basis functions phi, M_e their mass matrix, and psi = D_e M_e^-1
phi the dual basis: int psi_i phi_j = 0 for i other than j. The row of node j weighs the jump,

    d_j.(u_j - sum_k (int psi_j phi'_k / D_j) u'_k)  <=  int psi_j eps / D_j,

with D_j the integral of phi_j over all facing parts, so that it has one unknown of the secondary as
(2.10) has. Dual bases: Wohlmuth 2000, SIAM J. Numer. Anal. 38:989; of higher order Popp, Wohlmuth,
Gee, Wall 2012, SIAM J. Sci. Comput. 34:B421. On Gauss-Lobatto nodes the psi of straight segments
that face wholly contain the continuous functions of degree p - 1, since the quadrature of these
nodes is exact to degree 2 p - 1; on others the constants.

Where a segment faces in part, D_e need not be positive from order 2 on: hats of its ends replace
phi, with more unknowns in a row, but the node's alone on curves: rotations along them close no gap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, across, from_triplets
from ..fem import BoundaryTrace
from ..lagrange import at, gauss, lagrange
from ..problem import Contact
from .line import (
    ContactLine,
    Line,
    jacobian,
    no_point_faces,
    nodal_line,
    partners,
    prescribed_gap,
    rays,
    segment_weights,
    with_roles,
    without,
)
from .projection import crossings, feet

SLIVER = 1e-9  # share of a segment below which a piece of it is none
MIN_COVERED = 0.1  # of the integral of phi over the whole segment, below which hats take its place


@dataclass(frozen=True, eq=False)
class FacingPieces:
    """Parts of secondary segments that face one primary segment each."""

    local: Index  # (r,) number of the segment among those divided
    start: Array  # (r,) where its interval of the parameter begins
    stop: Array  # (r,) and ends
    facing: Index  # (r,) segment of the primary that it faces
    opposite: Array  # (r,) parameter on it that its middle faces


def divided(trace: BoundaryTrace, contact: Contact, segments: Index, facing: Index) -> FacingPieces:
    """Divide `segments` (k,) where they pass vertices of the primary segments `facing` (q,)."""
    k, ends = len(segments), trace.nodes[facing][:, [0, -1]]
    _, first = np.unique(ends, return_index=True)
    x = trace.curve[facing][:, [0, -1]].reshape(-1, 2)[first]
    xi = None if contact.direction is None else np.array(contact.direction)
    passing, s = feet(x, trace.curve[segments], xi)
    local = np.concatenate([passing, np.arange(k), np.arange(k)])
    cut = np.concatenate([s, np.zeros(k), np.ones(k)])
    order = np.lexsort((cut, local))
    local, cut = local[order], cut[order]
    one = (local[1:] == local[:-1]) & (np.diff(cut) > SLIVER)
    local, start, stop = local[:-1][one], cut[:-1][one], cut[1:][one]
    segment, middle = segments[local], (start + stop) / 2
    d = rays(trace, contact, segment, middle)
    met = partners(trace, facing, segment, trace.point(segment, middle), d)
    on = met.segment >= 0
    return FacingPieces(local[on], start[on], stop[on], met.segment[on], met.s[on])


def _dual_basis(whole: Array, weight: Array, mass: Array, s: Array) -> tuple[Array, Mask]:
    """Dual bases of k segments over their facing parts: psi = change phi, `change` (k, p+1, p+1).

    And the segments (k,) on which psi are those of the hats of the ends, or one constant. There
    D_e, the integrals `weight` (k, p + 1) of phi over the facing parts, are set to what the rows
    weigh, 0 for none. `whole` (k, p + 1) are those over the segments, `mass` (k, p + 1, p + 1) the
    integrals of phi_i phi_j over the facing parts, and `s` (k, p + 1) the parameters of the nodes.
    """
    faces, order = (mass != 0).any(axis=(1, 2)), s.shape[1] - 1
    sliver = faces & (weight.sum(axis=1) < MIN_COVERED * whole.sum(axis=1))  # a row at one end
    hats = faces & ~sliver & (weight < MIN_COVERED * whole).any(axis=1) & (order > 1)
    change = np.zeros_like(mass)
    full = faces & ~hats & ~sliver
    change[full] = weight[full][:, :, None] * np.linalg.inv(mass[full])
    hat = lagrange(1, s.ravel()).reshape(-1, order + 1, 2)  # values at the nodes of phi
    D = np.einsum("ki,kij->kj", weight, hat)
    ends, hat = (np.flatnonzero(hats)[:, None], np.array([[0, order]])), hat[hats]
    turned = hat.transpose(0, 2, 1)
    change[ends] = D[hats][:, :, None] * (np.linalg.inv(turned @ mass[hats] @ hat) @ turned)
    share = weight[sliver].sum(axis=1)
    nearer = np.flatnonzero(sliver), order * (D[sliver] @ [-1, 1] > SLIVER * share)
    change[nearer] = 1.0
    weight[hats | sliver] = 0.0
    weight[ends], weight[nearer] = D[hats], share
    return change, hats | sliver


def _integrals(
    trace: BoundaryTrace, contact: Contact, segments: Index, pieces: FacingPieces
) -> tuple[Array, Array, sp.csr_array]:
    """Integrals over the facing parts of `segments` (k,), in arc length (P1) or eta (P2).

    D_e (k, p + 1) of the basis functions; of psi times eps, (k, p + 1), areas; and of psi times the
    basis functions of n nodes, (k * p + k, n): those of the primary, less those of the secondary
    itself but for D_e.
    """
    p, k, r = trace.order, len(segments), len(pieces.local)
    points, weights = gauss(2 * p + 2 * trace.geometry_order - 1)
    q, length = len(points), pieces.stop - pieces.start
    s = (pieces.start[:, None] + length[:, None] * points).ravel()
    local, facing = (np.repeat(x, q) for x in (pieces.local, pieces.facing))
    segment, x = segments[local], trace.point(segments[local], s)
    w = (length[:, None] * weights).ravel() * jacobian(trace, contact, segment, s)
    d = rays(trace, contact, segment, s)
    s_there = crossings(x, across(d), trace.curve, facing, np.repeat(pieces.opposite, q))
    eps = ((at(trace.curve, facing, s_there) - x) * d).sum(axis=1)
    if contact.gap is not None:
        eps = prescribed_gap(contact, trace, segment, s, x)
    phi = trace.shapes(segment, s).reshape(r, q, p + 1)
    phi_there = trace.shapes(facing, s_there).reshape(r, q, p + 1)
    w, eps = w.reshape(r, q), eps.reshape(r, q)
    weight, gap, mass = np.zeros((k, p + 1)), np.zeros((k, p + 1)), np.zeros((k, p + 1, p + 1))
    np.add.at(weight, pieces.local, np.einsum("rg,rgi->ri", w, phi))
    np.add.at(gap, pieces.local, np.einsum("rg,rgi->ri", w * eps, phi))
    np.add.at(mass, pieces.local, np.einsum("rg,rgi,rgj->rij", w, phi, phi))
    whole = segment_weights(trace, contact, segments)
    change, hats = _dual_basis(whole, weight, mass, trace.places(segments))
    facing_part = change[pieces.local] @ np.einsum("rg,rgi,rgj->rij", w, phi, phi_there)
    own_part = change @ mass - weight[:, :, None] * np.eye(p + 1)
    first, last = (rays(trace, contact, segments, np.full(k, s)) for s in (0.0, 1.0))
    hats &= np.abs(last - first).max(axis=1) <= SLIVER  # no turn
    own_part[~hats] = 0.0  # int psi_i phi_j = 0 but for i = j
    blocks = np.concatenate([facing_part, -own_part])
    row = np.concatenate([pieces.local, np.arange(k)])[:, None] * (p + 1) + np.arange(p + 1)
    column = trace.nodes[np.concatenate([pieces.facing, segments])]
    row, column = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    size = (k * (p + 1), trace.space.ndof)
    coupling = from_triplets(blocks.ravel(), row.ravel(), column.ravel(), size)
    return weight, np.einsum("kij,kj->ki", change, gap), coupling


def end_to_end(trace: BoundaryTrace, line: ContactLine, facing: Mask) -> Index:
    """Segment of the primary whose two ends the two ends of a segment face, (k,), -1 where none.

    `facing` (m,) are the points that face the primary.
    """
    vertex = np.full(len(facing) + 1, -1)  # of the primary at each point
    at_end = facing & np.isin(line.partner_s, (0.0, 1.0))
    end = np.where(line.partner_s[at_end] == 0.0, 0, -1)
    vertex[:-1][at_end] = trace.nodes[line.partner[at_end], end]
    ends = line.rows[:, [0, -1]]
    met = np.sort(np.where(ends < 0, -1, vertex[ends]), axis=1)
    sides = np.sort(trace.nodes[line.facing][:, [0, -1]], axis=1)
    size = trace.space.ndof
    keys, wanted = (x[:, 0] * size + x[:, 1] for x in (sides, met))
    order = np.argsort(keys)
    found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
    return np.where((met[:, 0] >= 0) & (keys[found] == wanted), line.facing[found], -1)


def with_dual_rows(
    trace: BoundaryTrace, line: ContactLine, facing: Mask
) -> tuple[ContactLine, Mask]:
    """The line with dual rows where nodes do not face nodes, and which points (m,) carry rows.

    The `line` has points at all nodes of the secondary, of which `facing` (m,) face the primary. A
    point on segments of both kinds takes the mean of both rows, by their weights; one whose
    segments all match keeps the row at its node to the last bit.
    """
    if len(line.facing) == 0:
        return line, facing
    matched = (end_to_end(trace, line, facing) >= 0) & (line.contact.rows != "dual")
    chosen = np.flatnonzero(~matched)
    if len(chosen) == 0:
        return line, facing
    segments = line.segments[chosen]
    pieces = divided(trace, line.contact, segments, line.facing)
    D, gaps, coupling = _integrals(trace, line.contact, segments, pieces)
    covered = np.bincount(pieces.local, pieces.stop - pieces.start, minlength=len(chosen))
    whole = covered > 1 - SLIVER
    return with_means(trace, line, facing, matched, FacingMeans(D, gaps, coupling, whole))


@dataclass(frozen=True, eq=False)
class FacingMeans:
    """Integrals over the facing parts of k segments, of q nodes each."""

    D: Array  # (k, q) of the basis functions
    gaps: Array  # (k, q) of psi times eps
    coupling: sp.csr_array  # (k * q, n) of psi times the basis functions of the primary
    whole: Mask  # (k,) segments that face it wholly


def with_means(
    trace: BoundaryTrace, line: Line, facing: Mask, matched: Mask, found: FacingMeans
) -> tuple[Line, Mask]:
    """The line with the means `found` on segments not `matched` (k,), and who carries rows (m,).

    Of its points `facing` (m,) face the primary.
    """
    chosen, D, gaps, coupling = np.flatnonzero(~matched), found.D, found.gaps, found.coupling
    segments, rows, m = line.segments[chosen], line.rows[chosen], len(facing)
    here = (rows >= 0) & (D > 0)
    point = rows[here]
    cosine = np.ones(len(point))
    if line.contact.direction is None:  # of normals, where two sides share a point
        normal = trace.exact_normal(*trace.at_nodes(segments))[here.ravel()]
        cosine = (normal * line.direction[point]).sum(axis=1)
    faces, covered = line.faces.copy(), line.covered.copy()
    faces[chosen] = found.whole & here.all(axis=1)
    weights = np.where(here, D, 0.0)
    weights[here] *= cosine
    covered[chosen] = weights
    nodal, dual, gap = np.zeros(m), np.zeros(m), np.zeros(m)
    np.add.at(nodal, line.rows[matched], line.shares[matched])
    np.add.at(dual, point, weights[here])
    np.add.at(gap, point, gaps[here] * cosine)
    at_nodes, carries = dual == 0, (dual > 0) | (facing & (nodal > 0))
    weight = np.where(at_nodes, 1.0, nodal + dual)
    share = np.where(at_nodes, 1.0, nodal / weight)  # of the row at the node
    scale, shape = cosine / weight[point], (m, coupling.shape[0])
    means = from_triplets(scale, point, np.flatnonzero(here), shape) @ coupling
    line = replace(
        line,
        gap=share * np.where(share > 0, line.gap, 0.0) + gap / weight,
        # By matched segments, without one of which the ends alone face, over a slot at order 1.
        weight=np.where(at_nodes, np.where(nodal > 0, nodal, line.weight), nodal + dual),
        coupling=(sp.diags_array(share) @ line.coupling + means).tocsr(),
        means=~at_nodes,
        faces=faces,
        covered=covered,
        searches=1,
    )
    return line, carries


def contact_line(trace: BoundaryTrace, contact: Contact, taken: Index | None = None) -> ContactLine:
    """Contact points of one pair: at nodes where nodes face nodes, with dual rows elsewhere.

    Segments `taken` (j,) of its secondary belong to other pairs.

    Raises
    ------
    ValueError
        No point of the secondary faces the primary.
    """
    contact = with_roles(trace, contact)
    line, facing = nodal_line(trace, contact, taken)
    if contact.primary is not None and contact.rows != "nodal":
        line, facing = with_dual_rows(trace, line, facing)
    if len(line.segments) and not facing.any():
        raise ValueError(no_point_faces(contact))
    return without(line, np.flatnonzero(~facing))
