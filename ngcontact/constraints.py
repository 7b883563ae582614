"""Supports and contact rows as arrays: a basis with an unknown for each. Arrays only.

K_h = {B v <= g} of HH81 (2.3), (2.5), (2.10).

All conditions hold at nodes. A change of basis, local to the nodes concerned, makes the left
side of every contact row - the normal value of a rigid pair, the jump between two bodies - an
unknown of its own: an active row is a fixed unknown, and every Newton step has a symmetric
positive definite sparse matrix. NumPy and SciPy only, in any number d of dimensions.

A row replaces an unknown of the secondary's node, unless its displacement is prescribed there or
other rows took its directions; then of a node of the facing segment. Between a stiff and a soft
body it is the soft one's node: the row's force is the unbalanced force there, which round-off of
the stiff one would drown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from .arrays import Array, Columns, Index, Mask, dense, from_triplets

ROW_DIFFERENCE = 1e-9  # difference of coefficients, each at most 1, below which two rows are one
SOFT_CONDITION = 1e2  # condition number of rows up to which softer bodies in front host them
RING_CONDITION = 1e6  # condition number from which rows that refer to each other are dependent
MIN_PIVOT = 0.05  # least share of a row at the node whose unknown it becomes, if others have more
MIN_SINE = 1e-6  # sine below which two conditions at one node are the same
INTERPOLATION_ERROR = 1e-8  # of prescribed values, relative to the largest: no interference
COORDINATE_ERROR = 1e-13  # of gaps, relative to the largest coordinate: none either
INDEPENDENT_ROWS = (
    "exchange the sides of a pair whose secondary is the finer one and is held at an edge, leave "
    'out rows="nodal", give each pair of boundaries once, or end one of them before that point'
)
STIFFNESS_CONTRAST = 1e3  # of the secondary and what faces it, above which the latter hosts


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions a.u(x_i) = value at nodes, those of Gamma_u before those of Gamma_0."""

    node: Index  # (k,) numbers i of the nodes
    direction: Array  # (k, d) unit vectors a
    value: Array  # (k,) prescribed displacements along them, in units of length


@dataclass(frozen=True, eq=False)
class Entries:
    """The k nodes that rows concern."""

    row: Index  # (k,) number of the row, rising
    node: Index  # (k,) number of the node
    coefficient: Array  # (k, d) of its values


@dataclass(frozen=True, eq=False)
class Rows:
    """Contact rows d_j.(u(x_j) - sum_k c_jk u(x_k)) <= g_j, m of them, on n nodes.

    The sum is the displacement that faces node j: the trace of the facing body at one point for
    rows at nodes, a mean of it for others.
    """

    node: Index  # (m,) node j of the secondary
    direction: Array  # (m, d) unit vectors
    # (m, n) weights c of the nodes of the facing body; an empty row for a rigid obstacle
    coupling: sp.csr_array
    g: Array  # (m,) bounds, in units of length
    equality: Mask  # (m,) rows that hold with equality, Remark 3.3

    @cached_property
    def entries(self) -> Entries:
        """Coefficients of the node values in each row, in the order of rows and nodes."""
        c, (m, n) = self.coupling, self.coupling.shape
        row = np.concatenate([np.arange(m), np.repeat(np.arange(m), np.diff(c.indptr))])
        weight = np.concatenate([np.ones(m), -c.data])
        place, same = np.unique(
            row * n + np.concatenate([self.node, c.indices]), return_inverse=True
        )
        # (2.3), (2.5): n.(v' - v''); (2.10): v''_xi - v'_xi
        weight = np.bincount(same, weight, len(place))
        row, node = np.divmod(place, max(n, 1))
        return Entries(row, node, weight[:, None] * self.direction[row])

    @cached_property
    def matrix(self) -> sp.csr_array:
        """B (m, d * n) on node values: x components first, then y."""
        (m, n), d, e = self.coupling.shape, self.direction.shape[1], self.entries
        columns = np.concatenate([e.node + i * n for i in range(d)])
        B = from_triplets(e.coefficient.T.ravel(), np.tile(e.row, d), columns, (m, d * n))
        B.eliminate_zeros()
        return B

    def left_sides(self, values: Columns) -> Columns:
        """Left sides (m, r) of node `values` (d * n, r): x components first, then y."""
        if sp.issparse(values):
            return self.matrix @ values
        e, result = self.entries, np.zeros((len(self.node), values.shape[1]))
        at = values.reshape(self.direction.shape[1], -1, values.shape[1])[:, e.node]
        np.add.at(result, e.row, np.einsum("ki,ikr->kr", e.coefficient, at))
        return result

    def alike(self, first: int, second: int) -> bool:
        """Whether two rows have the same left side."""
        difference = self.matrix[[first]] - self.matrix[[second]]
        return bool(np.abs(difference.data).max(initial=0.0) <= ROW_DIFFERENCE)


class Links(NamedTuple):
    """Coefficients of unknowns in contact rows, k of them."""

    value: Array  # (k,)
    own: Index  # (k,) unknown that the row is
    other: Index  # (k,) unknown that it contains beside


@dataclass(frozen=True, eq=False)
class BasisTransformation:
    """Node values u = T y in unknowns of which some are prescribed and one is each row's value."""

    T: sp.csr_array  # (d * n, d * n) from the unknowns to x of all nodes, then y
    links: Links  # what the rows contain of other unknowns than their own
    fixed: Mask  # (d * n,) prescribed unknowns
    values: Array  # (d * n,) their values
    unknown: Index  # (k,) unknown that equals the left side of each kept row
    kept: Index  # (k,) kept rows; the others are prescribed altogether and satisfied
    nodes: Index  # (j,) nodes that a condition or a row concerns, rising
    local: Array  # (j, d, d) from their values to their unknowns, but for the rows

    def coordinates(self, values: Columns, rows: Columns) -> Columns:
        """Unknowns (d * n, r) of node `values` (d * n, r), `rows` (k, r) on the kept rows."""
        (size, r), d = values.shape, self.local.shape[1]
        here = (self.nodes + size // d * np.arange(d)[:, None]).ravel()
        turned = dense(values[here]).reshape(d, -1, r)
        turned = np.einsum("nij,jnr->inr", self.local, turned)
        source = np.arange(size)  # among the rows of what follows, the last one 0
        source[here] = size + np.arange(here.size)
        source[self.unknown] = size + here.size + np.arange(len(self.unknown))
        source[self.fixed] = -1
        every = [values, turned.reshape(here.size, r), rows, np.zeros((1, r))]
        if sp.issparse(values):
            return sp.vstack(list(map(sp.csr_array, every)), format="csr")[source]
        return np.concatenate(every)[source]


@dataclass(frozen=True, eq=False)
class _Frames:
    """Orthonormal frames at n nodes; the first columns span the conditions met so far."""

    columns: Array  # (n, d, d)
    used: Index  # (n,) how many columns that are

    def take(self, node: Index, a: Array) -> Index:
        """Turn the frames so that a column more of each `node` (k,) spans its vector `a` (k, d).

        Returns that column (k,), or -1 where the vector depends on those before.
        """
        column = np.full(len(node), -1)
        order = np.argsort(node, kind="stable")
        _, first, count = np.unique(node[order], return_index=True, return_counts=True)
        for turn in range(count.max(initial=0)):
            at = order[first[count > turn] + turn]
            parts = np.einsum("kij,ki->kj", self.columns[node[at]], a[at])
            parts[np.arange(a.shape[1]) < self.used[node[at], None]] = 0.0
            size = np.linalg.norm(parts, axis=1)
            new = size > MIN_SINE * np.linalg.norm(a[at], axis=1)
            at, q = at[new], parts[new] / size[new, None]
            # Householder's reflection of the next axis to q, or to -q
            i, k, each = node[at], self.used[node[at]], np.arange(len(at))
            v = q.copy()
            v[each, k] += np.where(q[each, k] < 0, -1.0, 1.0)
            H = np.eye(a.shape[1]) - 2 * v[:, :, None] * (v / (v**2).sum(1)[:, None])[:, None]
            H[each, :, k] = q
            self.columns[i] = self.columns[i] @ H
            self.used[i] += 1
            column[at] = k
        return column


@dataclass(frozen=True, eq=False)
class _Supported:
    """Supports at n nodes of a mesh."""

    nodes: Index  # (n,) their numbers in the mesh, rising; few of it
    frames: _Frames  # whose first columns are the supported directions
    values: Array  # (n, d) prescribed along the columns

    @property
    def fixed(self) -> Mask:
        """Mask (n, d) of the components in the frames that are prescribed."""
        return np.arange(self.values.shape[1]) < self.frames.used[:, None]


def _axes(nodes: Index, d: int) -> Array:
    """Frames (n, d, d) along the axes at so many nodes."""
    return np.tile(np.eye(d), (len(nodes), 1, 1))


def _supported(c: Conditions, rows: Rows) -> _Supported:
    """The supports that conditions make at the nodes that any of them, or a row, concerns."""
    nodes = np.unique(np.append(c.node, rows.entries.node))
    d, node = c.direction.shape[1], np.searchsorted(nodes, c.node)
    frames = _Frames(_axes(nodes, d), np.zeros(len(nodes), dtype=np.intp))
    values, slot = np.zeros((len(nodes), d)), frames.take(node, c.direction)
    for k in range(d):  # values along the columns before are known
        at = slot == k
        i = node[at]
        parts = np.einsum("kij,ki->kj", frames.columns[i], c.direction[at])
        before = (parts[:, :k] * values[i, :k]).sum(axis=1)
        values[i, k] = (c.value[at] - before) / parts[:, k]
    return _Supported(nodes, frames, values)


def _preferred(rows: Rows, nodes: Index, stiffness: Array | None) -> Index:
    """Places (m,) among `nodes` (n,): the secondary's, or a much softer one that faces it."""
    if rows.coupling.nnz == 0 or stiffness is None:
        return np.searchsorted(nodes, rows.node)
    coupling = rows.coupling.tocoo()
    rising = np.argsort(np.abs(coupling.data), kind="stable")
    facing = rows.node.copy()  # where nothing does
    facing[coupling.row[rising]] = coupling.col[rising]  # the largest comes last
    softer = STIFFNESS_CONTRAST * stiffness[facing] < stiffness[rows.node]
    return np.searchsorted(nodes, np.where(softer, facing, rows.node))


def _hosts(preferred: Index, entries: Entries, frames: _Frames) -> tuple[Index, Index, Array]:
    """Node (m,) at which each row becomes an unknown, -1 where all of it is prescribed.

    And the slot (m,) and the coefficients (m, d) there. Of rows with the nodes `preferred` (m,) and
    the `entries`, without prescribed unknowns.
    """
    n, m = len(frames.used), len(preferred)
    host, slot = preferred.copy(), np.full(m, -1)
    place = np.searchsorted(entries.row * n + entries.node, np.arange(m) * n + preferred)
    local = entries.coefficient[place]
    single = np.bincount(host, minlength=n)[host] == 1
    regular = (single & (np.linalg.norm(local, axis=1) > MIN_PIVOT)).nonzero()[0]
    slot[regular] = frames.take(host[regular], local[regular])
    for j in (slot < 0).nonzero()[0]:
        here = slice(*np.searchsorted(entries.row, [j, j + 1]))
        nodes, size = entries.node[here], np.linalg.norm(entries.coefficient[here], axis=1)
        ranked = np.lexsort((-nodes, -size, nodes != preferred[j]))
        host[j] = -1
        for i in (i for least in (MIN_PIVOT, MIN_SINE) for i in ranked if size[i] > least):
            coefficient = entries.coefficient[here][i]
            slot[j] = frames.take(nodes[[i]], coefficient[None])[0]
            if slot[j] >= 0:
                host[j], local[j] = nodes[i], coefficient
                break
    return host, slot, local


def _check_prescribed(
    rows: Rows, entries: Entries, supported: _Supported, dropped: Index, length: float
) -> None:
    """Raise unless the `dropped` rows, of no free unknown, hold for the prescribed values.

    The `entries` are those in the frames of the nodes; gaps are known to the round-off of `length`.
    """
    size = np.abs(supported.values).max(initial=0.0)
    for j in dropped:
        here = entries.row == j
        node, coefficient = entries.node[here], entries.coefficient[here]
        where = f"the contact row at node {rows.node[j]} with direction {rows.direction[j]}"
        if (np.abs(coefficient[~supported.fixed[node]]) > MIN_SINE).any():
            raise ValueError(f"{where} depends on other contact rows there; {INDEPENDENT_ROWS}")
        value = float((coefficient * supported.values[node]).sum())
        allowed = INTERPOLATION_ERROR * max(size, abs(rows.g[j])) + COORDINATE_ERROR * length
        excess = value - rows.g[j]
        if (abs(excess) if rows.equality[j] else excess) > allowed:
            raise ValueError(
                f"{where} is violated by prescribed displacements on both sides: they close the "
                f"gap by {value:g} where it is {rows.g[j]:g}; prescribe displacements without "
                "interference"
            )


def _without_links(C: sp.csr_array, right: sp.csr_array, most: float) -> sp.csr_array | None:
    """Solution Y of (I + C) Y = `right`: rows that contain the unknowns of other rows.

    Few do, where contact lines of several bodies share nodes. None where those that refer to each
    other have a condition number of more than `most`.
    """
    linked, alone = np.flatnonzero(np.diff(C.indptr)), np.diff(C.indptr) == 0
    block = np.eye(linked.size) + C[linked][:, linked].toarray()
    _, group = connected_components(block, connection="strong")
    ring = np.flatnonzero(np.bincount(group)[group] > 1)
    if ring.size and np.linalg.cond(block[np.ix_(ring, ring)]) > most:
        return None
    known = sp.diags_array(alone.astype(float)) @ right
    place = sp.eye_array(C.shape[0], format="csr")[:, linked]
    return known + place @ sp.csr_array(np.linalg.inv(block)) @ (right - C @ known)[linked]


def _in_frames(rows: Rows, supported: _Supported) -> tuple[Entries, Entries]:
    """Entries of `rows` in the frames, by their numbers, and what supports leave free of them."""
    e, fixed, frame = rows.entries, supported.fixed, supported.frames.columns
    node = np.searchsorted(supported.nodes, e.node)
    e = Entries(e.row, node, np.einsum("ki,kij->kj", e.coefficient, frame[node]))
    return e, replace(e, coefficient=np.where(fixed[node], 0.0, e.coefficient))


def held_rows(conditions: Conditions, rows: Rows, length: float) -> Mask:
    """Rows (m,) at nodes which `conditions` leave no displacement along their directions.

    Prescribed displacements on both sides that violate a row are refused, overlaps as drawn not.
    """
    m, supported = len(rows.node), _supported(conditions, rows)
    e, free = _in_frames(rows, supported)
    size = np.linalg.norm(free.coefficient, axis=1)
    own = rows.entries.node == rows.node[e.row]
    whole = (np.bincount(e.row, size > MIN_SINE, m) == 0) & (np.diff(rows.coupling.indptr) > 0)
    g = np.where(rows.equality, rows.g, np.maximum(rows.g, 0.0))
    _check_prescribed(replace(rows, g=g), e, supported, np.flatnonzero(whole), length)
    return np.bincount(e.row[own], size[own], m) <= MIN_PIVOT


def change_of_basis(
    conditions: Conditions,
    rows: Rows,
    length: float = 0.0,
    stiffness: Array | None = None,
) -> BasisTransformation:
    """Basis in which prescribed conditions and contact rows on n nodes are single unknowns.

    The `length` is the largest coordinate, to whose round-off the gaps are known; `stiffness` (n,)
    the force per displacement at the nodes, by its order of magnitude, alike when left out.
    Prescribed displacements on both sides that violate a row, and rows that depend on each other,
    are refused.
    """
    (m, n), d = rows.coupling.shape, rows.direction.shape[1]
    supported = _supported(conditions, rows)
    nodes = supported.nodes  # k of them, by whose numbers all but T counts
    components = (nodes + n * np.arange(d)[:, None]).ravel()  # theirs among those of all nodes
    frame, fixed = supported.frames.columns, supported.fixed
    e, free = _in_frames(rows, supported)
    taken = _Frames(_axes(nodes, d), supported.frames.used.copy())
    preferred = _preferred(rows, nodes, stiffness)
    host, slot, local = _hosts(preferred, free, taken)
    kept = (host >= 0).nonzero()[0]
    _check_prescribed(rows, e, supported, (host < 0).nonzero()[0], length)
    M = taken.columns.transpose(0, 2, 1).copy()
    M[host[kept], slot[kept]] = local[kept]
    inverse = _axes(nodes, d)
    inverse[host[kept]] = np.linalg.inv(M[host[kept]])
    blocks = frame @ inverse
    # What rows contain beside the free values of their hosts moves to the right.
    own = (e.node == host[e.row])[:, None] & ~fixed[e.node]
    rest = np.einsum("ki,kij->kj", np.where(own, 0.0, e.coefficient), inverse[e.node])
    at, component = (rest * (host[e.row] >= 0)[:, None]).nonzero()
    row, column, value = e.row[at], e.node[at] + len(nodes) * component, rest[at, component]
    unknown = np.where(host >= 0, host + len(nodes) * slot, 0)
    of_row = np.zeros(components.size, dtype=bool)
    of_row[unknown[kept]] = True
    if of_row[column].any():  # unknowns of other rows
        right = from_triplets(value, row, column, (m, components.size))
        in_front = (nodes[preferred] != rows.node).any()
        most = SOFT_CONDITION if in_front else RING_CONDITION
        Y = _without_links(right[:, unknown].tocsr(), right, most)
        if Y is None and in_front:
            return change_of_basis(conditions, rows, length)  # the secondary hosts all
        if Y is None:
            raise ValueError(f"contact rows depend on each other in a ring; {INDEPENDENT_ROWS}")
        Y = Y.tocoo()
        row, column, value = Y.row, Y.col, Y.data
    column, unknown = components[column], components[unknown]
    node, i, j = blocks.nonzero()
    k, others = np.arange(d)[:, None], np.ones(d * n, dtype=bool)
    others[components] = False
    same = others.nonzero()[0]
    T = from_triplets(
        np.concatenate(
            [blocks[node, i, j], *(-blocks[host[row], k, slot[row]] * value), np.ones(same.size)]
        ),
        np.concatenate([nodes[node] + n * i, *(nodes[host[row]] + n * k), same]),
        np.concatenate([nodes[node] + n * j, *[column] * d, same]),
        (d * n, d * n),
    )
    prescribed, values = np.zeros(d * n, dtype=bool), np.zeros(d * n)
    prescribed[components], values[components] = fixed.T.ravel(), supported.values.T.ravel()
    return BasisTransformation(
        T=T,
        links=Links(value, unknown[row], column),
        fixed=prescribed,
        values=values,
        unknown=unknown[kept],
        kept=kept,
        nodes=nodes,
        local=M @ frame.transpose(0, 2, 1),
    )
