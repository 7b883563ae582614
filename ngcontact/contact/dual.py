"""Contact line of a pair: where nodes do not face nodes, rows are means over facing parts.

On a segment e of the secondary, restricted to its part that faces the primary, let D_e be the
diagonal of the integrals of the basis functions phi, M_e their mass matrix, and psi = D_e M_e^-1
phi the dual basis: int psi_i phi_j = 0 for i other than j. The row of node j weighs the jump,

    d_j.(u_j - sum_k (int psi_j phi'_k / D_j) u'_k)  <=  int psi_j eps / D_j,

with D_j the integral of phi_j over all facing parts, so that it has one unknown of the secondary as
(2.10) has. Where normals turn the weights are changed a little, so that the force on the primary is
in line with that on the node: moments balance, and no row resists the turn of a shaft in its hub.
Forces that act beside nodes, on solids that face in part, are along normals that belong there.
Dual bases: Wohlmuth 2000, SIAM J. Numer. Anal. 38:989; of higher order Popp, Wohlmuth, Gee, Wall
2012, SIAM J. Sci. Comput. 34:B421. On Gauss-Lobatto nodes the psi of straight segments that face
wholly contain the continuous functions of degree p - 1, since the quadrature of these nodes is
exact to degree 2 p - 1; on others the constants.

Where a segment faces in part, D_e need not be positive from order 2 on: hats of its ends replace
phi, with more unknowns in a row, but the node's alone on curves: rotations along them close no gap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, from_triplets, rotations, rows_of
from ..fem import BoundaryTrace, FacetTrace
from ..lagrange import lagrange
from ..problem import Contact
from ..qp import vanishing_combinations
from ..reference import triangle
from .facing import (
    SLIVER,
    WHOLE_SHARE,
    FacingPieces,
    distances,
    divided,
    interpolated_rays,
    opposite,
    opposite_segments,
    rays,
)
from .line import ContactLine
from .nodal import jacobian, nodal_line, prescribed_gap, segment_weights, with_roles
from .projection import MATCHING_DISTANCE

MIN_COVERED = 0.1  # of the integral of phi over the whole segment, below which hats take its place
# Sizes of a row's coefficients, which add up to 1, from which it extrapolates: 5 where facets face
# wholly at order 3. From 20 on multigrid takes more V-cycles.
LARGEST_SUM = 15.0
# Slope of a gap that rows follow beyond the part of a segment that faces. No row asks for less than
# the gap at its node or the least one of its segments less this share of their lengths: of strongly
# curved sides psi, which is negative in places, made negative means of gaps that are positive.
LARGEST_SLOPE = 0.01
SMALLEST_SHARE = 1e-8  # of a point's weight on its whole segments, below which it carries no row
ACROSS_SHARE = 0.5  # of a direction that is left across motions at least; else it stays as it is
LENGTH_STEP = 1e-6  # of the longest, in which lengths of edges are counted: round-off is no tie

# Which points (m,) of a line supports leave no displacement along their direction.
Held = Callable[[ContactLine], Mask]


def _dual_basis(
    trace: BoundaryTrace,
    contact: Contact,
    segments: Index,
    faces: Mask,
    weight: Array,
    mass: Array,
    at_nodes: Array,
) -> tuple[Array, Index]:
    """Dual bases of `segments` (k,) over their facing parts: psi = change chi, `change` (k, q, q).

    And the numbers (j,) of segments whose rows have several unknowns. In the plane psi may be those
    of the hats of the ends, or one constant. D_e, the integrals `weight` (k, q) of phi over the
    facing parts, are set to what the rows weigh, 0 for none. Segments that are `faces` (k,) have
    such parts, and `mass` (k, q, q) are the integrals of chi_i chi_j over these, chi the functions
    phi themselves or, in space, those of `_on_parts`, with phi = `at_nodes` chi.
    """
    change, order = np.zeros_like(mass), trace.order
    if trace.model.dim == 3:  # whose facets that face in part have functions that are not negative
        weight[~trace.weighs(segments)] = 0.0
        inverse = np.linalg.solve(at_nodes[faces].transpose(0, 2, 1), np.linalg.inv(mass[faces]))
        change[faces] = weight[faces][:, :, None] * inverse
        return change, np.zeros(0, dtype=np.intp)
    whole, s = segment_weights(trace, contact, segments), trace.places(segments)
    sliver = faces & (weight.sum(axis=1) < MIN_COVERED * whole.sum(axis=1))  # a row at one end
    hats = faces & ~sliver & (weight < MIN_COVERED * whole).any(axis=1) & (order > 1)
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
    in_part = np.flatnonzero(hats | sliver)
    turn = rays(trace, contact, *trace.at_places(segments[in_part], trace.vertices))
    turn = np.abs(np.diff(turn.reshape(-1, 2, 2), axis=1)).max(axis=(1, 2))
    return change, in_part[turn <= SLIVER]


def _on_parts(
    trace: BoundaryTrace, segments: Index, pieces: FacingPieces, each: Index, s: Array
) -> tuple[Array, Array]:
    """Lagrange's polynomials chi (r, q) of triangles as large as the facing parts of facets.

    At `s` (r, 3) on facets by number `each` (r,) among `segments` (k,); and phi (k, q, q) at the
    nodes of the triangles: phi times chi are phi. The mass matrix of phi itself is close to
    singular where little faces. Triangles have the centre and second moments of the `pieces`.
    """
    k, nodes, corners = len(segments), triangle.nodes(trace.order), pieces.corners[..., :2]
    own = np.bincount(pieces.local, pieces.share, k)
    share, some = (pieces.share / own[pieces.local])[:, None], own > 0
    middle, moment = np.full((k, 2), 1 / 3), np.tile(np.eye(2), (k, 1, 1))
    middle[some], moment[some] = 0.0, SLIVER**2 * np.eye(2)
    np.add.at(middle, pieces.local, share * corners.mean(axis=1))
    x = corners - middle[pieces.local, None]
    x = np.concatenate([x, 3 * x.mean(axis=1, keepdims=True)], axis=1)
    np.add.at(moment, pieces.local, share[:, None] * (x.transpose(0, 2, 1) @ x))
    x = triangle.nodes(1)[:, :2] - 1 / 3
    frame = np.linalg.cholesky(moment) @ np.linalg.inv(np.linalg.cholesky(x.T @ x))

    def barycentric(x: Array) -> Array:
        return np.concatenate([x, 1 - x.sum(axis=-1, keepdims=True)], axis=-1)

    places = middle[:, None] + (nodes[:, :2] - 1 / 3) @ frame.transpose(0, 2, 1)
    phi = trace.shapes(segments.repeat(len(nodes)), barycentric(places).reshape(-1, 3))
    own_places = np.einsum("rij,rj->ri", np.linalg.inv(frame)[each], s[:, :2] - middle[each])
    chi = triangle.lagrange(trace.order, barycentric(own_places + 1 / 3))
    return chi, phi.reshape(k, len(nodes), -1).transpose(0, 2, 1)


def _integrals(
    trace: BoundaryTrace, contact: Contact, segments: Index, pieces: FacingPieces
) -> tuple[Array, Array, sp.csr_array, Array]:
    """Integrals over the facing parts of `segments` (k,), in size (P1) or eta (P2).

    D_e (k, q) of the basis functions; of psi times eps, (k, q); and of psi times the functions of
    n nodes, (k * q, n): those of the primary, less those of the secondary itself but for D_e. And
    the least eps (k,), infinite where nothing faces.
    """
    k, r, q = len(segments), len(pieces.local), trace.nodes.shape[1]
    points, weights = trace.rule(2 * trace.order + 2 * (trace.geometry_order - 1))
    g, s = len(points), pieces.places(points)
    each = rows_of(pieces, np.arange(r).repeat(g))
    segment = segments[each.local]
    x = trace.point(segment, s)
    w = jacobian(trace, contact, segment, s).reshape(r, g) * pieces.share[:, None] * weights
    d = interpolated_rays(trace, contact, segments, each.local, s)
    there, eps = opposite(trace, x, d, each.facing, each.opposite)
    met = np.isfinite(eps)  # else beside the curved facet, whose corners were clipped
    w, eps = w * met.reshape(r, g), np.where(met, eps, 0.0)
    if contact.gap is not None:
        eps = prescribed_gap(contact, trace, segment, s, x)
    phi = trace.shapes(segment, s).reshape(r, g, q)
    phi_there = trace.shapes(each.facing, there).reshape(r, g, q)
    weight, gap, mass = np.zeros((k, q)), np.zeros((k, q)), np.zeros((k, q, q))
    chi, at_nodes = phi, mass
    if trace.model.dim == 3:
        chi, at_nodes = _on_parts(trace, segments, pieces, each.local, s)
        chi = chi.reshape(r, g, q)
    np.add.at(weight, pieces.local, np.einsum("rg,rgi->ri", w, phi))
    np.add.at(gap, pieces.local, np.einsum("rg,rgi->ri", w * eps.reshape(r, g), chi))
    np.add.at(mass, pieces.local, np.einsum("rg,rgi,rgj->rij", w, chi, chi))
    faces = pieces.covered(k) > SLIVER
    change, hats = _dual_basis(trace, contact, segments, faces, weight, mass, at_nodes)
    facing_part = change[pieces.local] @ np.einsum("rg,rgi,rgj->rij", w, chi, phi_there)
    own_part = change[hats] @ mass[hats] - weight[hats, :, None] * np.eye(q)
    blocks = np.concatenate([facing_part, -own_part])
    row = np.concatenate([pieces.local, hats])[:, None] * q + np.arange(q)
    column = trace.nodes[np.concatenate([pieces.facing, segments[hats]])]
    row, column = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    size = (k * q, trace.space.ndof)
    coupling = from_triplets(blocks.ravel(), row.ravel(), column.ravel(), size)
    least = np.full(k, np.inf)
    np.minimum.at(least, pieces.local, np.where(w > 0, eps.reshape(r, g), np.inf).min(axis=1))
    return weight, np.einsum("kij,kj->ki", change, gap), coupling, least


def _passed_on(line: ContactLine, rows: Index, held: Mask) -> Index:
    """The point (k, q) whose row takes what weighs at each of the points `rows` (k, q), or -1.

    That is the point itself, or, where it is `held`, the nearest that is not, along edges and
    nodes of the facets; a held one itself where none is. No point, -1, is not `held` (m + 1,).
    """
    m = len(held) - 1
    to, free = np.append(np.arange(m), -1), np.unique(rows[(rows >= 0) & ~held[rows]])
    if not free.size:
        return rows
    pair = np.stack(np.broadcast_arrays(line.rows[:, :, None], line.rows[:, None]), axis=-1)
    pair = np.unique(pair[(pair >= 0).all(axis=-1) & (pair[..., 0] < pair[..., 1])], axis=0)
    length = np.linalg.norm(np.diff(line.position[pair], axis=1)[:, 0], axis=1)
    length = np.ceil(length / (LENGTH_STEP * length.max()) - 0.5)
    graph = from_triplets(length, pair[:, 0], pair[:, 1], (m, m))
    _, _, nearest = dijkstra(graph, False, free, True, min_only=True)
    to[:-1] = np.where(held[:-1] & (nearest >= 0), nearest, to[:-1])
    return np.asarray(to[rows])


def _across_turns(line: ContactLine, place: Array, d: Array) -> Array:
    """Unit vectors (m, 3) near `d` (m, 3), across what moves the secondary in itself at `place`.

    These are the rigid motions that are nowhere along the normals at the nodes of the `line`: turns
    and shifts of round and plane faces close no gap, nor do forces beside the nodes resist them.
    """
    middle, size = line.position.mean(axis=0), np.ptp(line.position, axis=0).max()

    def moved(x: Array) -> Array:
        shifts = np.broadcast_to(np.eye(3), (len(x), 3, 3))
        return np.concatenate([shifts, rotations((x - middle) / size)], axis=2)

    resisted = np.einsum("mi,mij->mj", line.direction, moved(line.position))
    along = moved(place) @ vanishing_combinations(resisted)
    left = d - np.einsum("mij,mjk,mk->mi", along, np.linalg.pinv(along, SLIVER), d)
    size = np.linalg.norm(left, axis=1)[:, None]
    # Few nodes resist few motions of faces that are neither round nor plane.
    return np.where(size > ACROSS_SHARE, left / np.maximum(size, ACROSS_SHARE), d)


def _in_line(place: Array, line: ContactLine, primary: Index, coupling: sp.csr_array) -> Array:
    """Changes (e,) of the weights of a `coupling` (m, n) that bring reactions in line with forces.

    Least weights of nodes of the `primary`, of their sizes, that leave the sum of a row as it is.
    They take its mean of `place` (n, d) to the line along d_j through the node.
    """
    row, column = np.repeat(np.arange(len(line.node)), np.diff(coupling.indptr)), coupling.indices
    d, own = line.direction, np.isin(column, primary)

    def across(vectors: Array, row: Index) -> Array:
        return np.asarray(vectors - d[row] * (vectors * d[row]).sum(axis=1)[:, None])

    every, size = np.arange(len(d)), np.abs(coupling.data) * own
    sizes = sp.csr_array((size, column, coupling.indptr), coupling.shape)
    total = np.asarray(sizes.sum(axis=1))[:, None]
    middle = np.divide(sizes @ place, total, out=np.zeros_like(d), where=total > 0)
    arm = across(place[column] - middle[row], row)
    moment = np.zeros((len(d), d.shape[1], d.shape[1]))
    np.add.at(moment, row, size[:, None, None] * arm[:, :, None] * arm[:, None])
    off = across(coupling @ place - place[line.node] * coupling.sum(axis=1)[:, None], every)
    tilt = np.linalg.pinv(moment, rcond=SLIVER, hermitian=True) @ off[:, :, None]
    return np.asarray(-size * (arm * tilt[row, :, 0]).sum(axis=1))


def with_dual_rows(
    trace: BoundaryTrace, line: ContactLine, facing: Mask, held: Held | None = None
) -> tuple[ContactLine, Mask]:
    """The line with dual rows where nodes do not face nodes, and which points (m,) carry rows.

    The `line` has points at all nodes of the secondary, of which `facing` (m,) face the primary. A
    point on segments of both kinds takes the mean of both rows, by their weights; one whose
    segments all match keeps the row at its node to the last bit.

    Rows of nodes `held` along their directions would have to be unknowns of the primary, of which
    a coarser one has too few; those of nodes of which little faces extrapolate, with large entries
    of both signs. The psi of these nodes are added to those of nodes beside, so that the sum of all
    stays 1, as at the ends of interfaces in mortar methods.
    """
    contact, m = line.contact, len(facing)
    matched = (opposite_segments(trace, line, facing) >= 0) & (contact.rows != "dual")
    if matched.all():
        return line, facing
    fixed = np.zeros(m + 1, dtype=bool)
    if held is not None:
        fixed[:-1] = held(line)
        matched &= ~fixed[line.rows].any(axis=1)  # else nodal rows alone would be left there
    chosen = np.flatnonzero(~matched)
    segments, rows = line.segments[chosen], line.rows[chosen]
    pieces = divided(trace, contact, segments, line.facing, distances(trace, line)[chosen])
    D, gaps, coupling, least = _integrals(trace, contact, segments, pieces)
    here, own = (rows >= 0) & (D > 0), rows
    nodal, whole, reached = np.zeros((3, m))
    np.add.at(nodal, line.rows[matched], line.shares[matched])
    np.add.at(whole, line.rows[line.rows >= 0], line.shares[line.rows >= 0])
    np.add.at(reached, rows[here], D[here])
    shape = m, coupling.shape[0]
    if trace.model.dim == 3:
        fixed[:-1] |= (reached > 0) & (nodal + reached < MIN_COVERED * whole)
        sums = from_triplets(np.ones(here.sum()), rows[here], np.flatnonzero(here), shape)
        fixed[:-1] |= abs(sums @ coupling).sum(axis=1) > LARGEST_SUM * reached
    passed = sp.csr_array(coupling.shape)
    if fixed.any():
        rows = np.where(here, _passed_on(line, np.where(here, rows, -1), fixed), rows)
        slot = np.flatnonzero(rows != own)
        at = np.concatenate([line.node[x.ravel()[slot]] for x in (rows, own)])
        values = np.outer([1.0, -1.0], D.ravel()[slot]).ravel()
        passed = from_triplets(values, np.tile(slot, 2), at, coupling.shape)
        coupling = coupling + passed
    point, points = rows[here], line.rows.copy()
    points[chosen] = rows
    cosine = np.ones(len(point))
    if contact.direction is None:  # of normals, where two sides share a point
        normal = trace.exact_normal(*trace.at_nodes(segments))[here.ravel()]
        cosine = (normal * line.direction[point]).sum(axis=1)
    across = np.where((rows != own)[here], 1.0, cosine)
    faces, covered = line.faces.copy(), line.covered.copy()
    faces[chosen] = (pieces.covered(len(chosen)) > WHOLE_SHARE) & here.all(axis=1)
    weights = np.where(here, D, 0.0)
    weights[here] *= across
    covered[chosen] = weights
    dual, gap = np.zeros((2, m))
    least -= LARGEST_SLOPE * trace.lengths(segments)
    lowest = np.where(facing, line.gap, np.inf)
    np.minimum.at(lowest, point, least[here.nonzero()[0]])
    np.add.at(dual, point, weights[here])
    np.add.at(gap, point, gaps[here] * cosine)
    at_nodes = dual == 0
    weight = np.where(at_nodes, 1.0, nodal + dual)
    share = np.where(at_nodes, 1.0, nodal / weight)  # of the row at the node
    lowest[at_nodes] = -np.inf
    mean = from_triplets(across / weight[point], point, np.flatnonzero(here), shape)
    position, coupling = line.position, mean @ coupling
    place = np.zeros((coupling.shape[1], trace.model.dim))
    for side in (line.segments, line.facing):
        place[trace.nodes[side]] = trace.positions(side)
    if isinstance(trace, FacetTrace):  # where forces act, so that moments balance
        position = np.where(trace.bernstein[line.node, None], place[line.node], position)
        position = position - mean @ passed @ place
    if contact.direction is None:
        if (position != line.position).any():  # whose normals are means and coefficients, too
            normal = D[..., None] * trace.unknowns_of_values(segments, line.direction[own])
            d = share[:, None] * line.direction + mean @ normal.reshape(D.size, -1)
            line = replace(line, direction=_across_turns(line, position, d))
        coupling.data += _in_line(place, line, trace.nodes[line.facing], coupling)
    line = replace(
        line,
        rows=points,
        gap=np.maximum(share * np.where(share > 0, line.gap, 0.0) + gap / weight, lowest),
        # By matched segments, without one of which the ends alone face, over a slot at order 1.
        weight=np.where(at_nodes, np.where(nodal > 0, nodal, line.weight), nodal + dual),
        position=position,
        coupling=(sp.diags_array(share) @ line.coupling + coupling).tocsr(),
        means=~at_nodes,
        faces=faces,
        covered=covered,
        searches=1,
    )
    # Forces of slivers are less than the round-off of the others.
    carries = ~at_nodes | (facing & (nodal > 0))
    return line, carries & (line.weight > SMALLEST_SHARE * whole)


def contact_line(
    trace: BoundaryTrace, contact: Contact, taken: Index | None = None, held: Held | None = None
) -> ContactLine:
    """Contact points of one pair: at nodes where nodes face nodes, with dual rows elsewhere.

    Segments `taken` (j,) of its secondary belong to other pairs. Supports leave the points that are
    `held` no displacement along their direction. A pair of which no point faces is refused.
    """
    contact = with_roles(trace, contact)
    line, carries = _points_of_rows(trace, contact, taken, held)
    return _carrying(line, carries)


def lines_together(trace: BoundaryTrace, contacts: Sequence[Contact]) -> list[ContactLine]:
    """Contact points of pairs that differ in their secondaries alone, which have no common nodes.

    As `contact_line` has them of each, found at once: each step costs what it costs of one pair.
    """
    every = replace(contacts[0], secondary="|".join(contact.secondary for contact in contacts))
    line, carries = _points_of_rows(trace, every)
    found = []
    for contact in contacts:
        own = trace.lies_on(line.segments, contact.secondary)
        part = replace(rows_of(line, own, *ContactLine.by_segment), contact=contact)
        points = np.isin(np.arange(len(carries)), part.rows)
        found.append(_carrying(part.with_points(points), carries[points]))
    return found


def _points_of_rows(
    trace: BoundaryTrace, contact: Contact, taken: Index | None = None, held: Held | None = None
) -> tuple[ContactLine, Mask]:
    """Points at all nodes of the secondary, and which (m,) carry rows, as of `contact_line`."""
    line, facing = nodal_line(trace, contact, taken)
    if contact.primary is not None and contact.rows != "nodal":
        line, facing = with_dual_rows(trace, line, facing, held)
    return line, facing & (line.weight > 0)


def _carrying(line: ContactLine, carries: Mask) -> ContactLine:
    """The line of the points (m,) that carry rows; raise a ValueError where none does."""
    contact = line.contact
    if len(line.segments) and not carries.any():
        xi = ", ".join(f"{x:.6g}" for x in contact.direction or ())
        raise ValueError(
            f'no point of the secondary "{contact.secondary}" faces the primary '
            f'"{contact.primary}" along {f"direction=({xi})" if xi else "its outward normals"}: '
            "choose boundaries that look at each other; the direction points from the secondary "
            "body to the primary one"
        )
    return line.with_points(carries)


def for_partial_cover(trace: BoundaryTrace, contacts: Sequence[Contact]) -> BoundaryTrace:
    """The trace with Bernstein coefficients where facets of a secondary face their primary in part.

    There the integrals of the other functions may be negative, and without some of these rows the
    psi would not add up to 1. In the plane hat functions replace phi, in the rows alone.
    """
    if not isinstance(trace, FacetTrace) or trace.order == 1:
        return trace
    chosen = np.zeros(trace.space.ndof, dtype=bool)
    for contact in (with_roles(trace, contact) for contact in contacts):
        facets, facing = trace.segments(contact.secondary), trace.segments(contact.primary)
        vertices, others = (np.unique(trace.nodes[x, :3]) for x in (facets, facing))
        if contact.rows == "nodal" or not others.size:
            continue
        x = trace.arrays.vertices
        apart = cKDTree(x[others]).query(x[vertices])[0].max(initial=0.0)
        if apart <= MATCHING_DISTANCE * np.ptp(x[vertices], axis=0).max():
            continue  # nodes face nodes
        reach = None
        if contact.direction is None:
            reach = distances(trace, nodal_line(trace, contact)[0])
        share = divided(trace, contact, facets, facing, reach).covered(len(facets))
        partly = (share > SLIVER) & (share < WHOLE_SHARE)
        chosen[trace.nodes[facets[partly], 3:]] = True
    return replace(trace, bernstein=chosen) if chosen.any() else trace
