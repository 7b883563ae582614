"""Boundary segments of a mesh with nodes at Gauss-Lobatto points.

All conditions on the boundary - Gamma_u, Gamma_0, Gamma_K - are posed at these nodes. A node is
named by the number of a scalar unknown of the finite element space: on boundary edges the
hierarchical edge unknowns of NGSolve are exchanged for values at the interior Gauss-Lobatto
points, so that every condition at a node concerns the two unknowns of that node alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..arrays import Array, Index, Mask, across, from_triplets, rightward
from ..lagrange import at, gauss, gauss_lobatto, lagrange, slope
from ..mesh import CadEdge, CadFace, cad_edges, cad_faces
from ..problem import POSITION, MeshArrays, Problem, boundary_mask
from .model import Model

CORNER = 5e-4  # turn (radians) from which two CAD edges meet at a corner: two rows at a smaller
# one would be dependent to 1 / turn^2
# Distance of a segment from its chord, relative to it, from which it is curved.
CURVED_DISTANCE = 1e-12
ENTRY_ROUND_OFF = 1e-13  # of changes of basis, whose entries are of size 1: round-off
CORNER_WITHOUT_CAD = np.deg2rad(30)  # ... and two segments of one name on a mesh without CAD
ORDERS = (1, 2, 3, 4)
ORDERS_OF_SOLIDS = (1, 2, 3)
ELEMENTS = ("isoparametric", "superparametric", "physical")


def unknowns(mesh: ng.Mesh, order: int, element: str) -> int:
    """Number of unknowns of the displacement on a mesh that is curved to the element's degree."""
    if mesh.dim == 3:  # `mesh.nedge` counts edges of no element after bisections
        return 3 * int(ng.H1(mesh, order=order).ndof)
    # Functions linear in physical coordinates are kept in a space with boundary edge functions.
    edges = mesh.GetNE(ng.BND) if element == "physical" and mesh.GetCurveOrder() > 1 else 0
    return unknowns_of(order, mesh.nv + edges, mesh.nedge, mesh.ne)


def unknowns_of(order: int, vertices: int, edges: int, elements: int) -> int:
    """Number of unknowns of a displacement of degree `order` on that many of each."""
    inner = (order - 1) * (order - 2) // 2
    return 2 * (vertices + (order - 1) * edges + inner * elements)


def check_element(order: int | str, element: str, dim: int = 2) -> int:
    """The order; raise unless the element is one of `ELEMENTS` with an order it is available in."""
    if dim == 3:
        if element != "isoparametric":
            raise ValueError(f"element={element!r} is for plane bodies: leave it out with solids")
        if order not in ORDERS_OF_SOLIDS:
            raise ValueError(f"order={order!r} is not available; solids have {ORDERS_OF_SOLIDS}")
    if element not in ELEMENTS:
        raise ValueError(f"element={element!r} is not available; choose one of {ELEMENTS}")
    orders = (1,) if element == "physical" else ORDERS
    if isinstance(order, bool) or not isinstance(order, int | np.integer):
        raise TypeError(f"order={order!r} is not an integer; element={element!r} has {orders}")
    if order not in orders:
        raise ValueError(f"order={order} is not available; element={element!r} has {orders}")
    return int(order)  # NGSolve knows no integers of NumPy


def physical_basis(V: ng.FESpace, trace: BoundaryTrace) -> sp.csr_array:
    """P1 in physical coordinates (2.4) inside the quadratic isoparametric space, (N, nv).

    On a curved element a linear function of x has the edge function coefficients that its
    values at the edge's interior nodes ask for; those values come from all three vertices.
    """
    mesh, view = trace.mesh, trace.arrays
    xy, triangles = view.vertices, view.elements[trace.element]
    if trace.geometry_order > 2:
        raise ValueError(
            f"the mesh is curved to degree {trace.geometry_order}; element='physical' lives on "
            "meshes curved to degree 2: call mesh.Curve(2)"
        )
    middle = trace.curve[:, 1] if trace.geometry_order == 2 else trace.curve.mean(axis=1)
    # Barycentric coordinates of the edge's node in the straight triangle, affinely extended.
    sides = xy[triangles[:, 1:]] - xy[triangles[:, :1]]
    bary = np.linalg.solve(sides.transpose(0, 2, 1), (middle - xy[triangles[:, 0]])[..., None])
    bary = np.column_stack([1 - bary.sum(axis=1), bary[..., 0]])
    # (2.4): the linear function of x at the edge's node, less the mean of its two ends.
    value = bary - np.where((triangles[:, :, None] == trace.nodes[:, None, :]).any(axis=2), 0.5, 0)
    numbers = np.array([[*V.GetDofNrs(el.edges[0]), -1][0] for el in mesh.Elements(ng.BND)])
    on = numbers >= 0
    bubble = 1 / ng.fem.H1FE(ng.ET.SEGM, 2).CalcShape(0.5).NumPy()[2]
    rows = np.repeat(numbers[on], 3)
    edges = from_triplets(
        (bubble * value[on]).ravel(), rows, triangles[on].ravel(), (V.ndof // 2, mesh.nv)
    )
    return (sp.eye_array(V.ndof // 2, mesh.nv) + edges).tocsr()


def vector_space(mesh: ng.Mesh, order: int, element: str) -> ng.FESpace:
    """Displacements on a curved mesh, as unknowns of NGSolve."""
    if element != "physical" or mesh.GetCurveOrder() == 1:
        return ng.VectorH1(mesh, order=order)  # (2.2); on curved elements (2.9)
    full = ng.VectorH1(mesh, order=2)
    half = full.ndof // 2
    active = np.zeros(half, dtype=bool)
    active[: mesh.nv] = True
    boundary = [el.edges[0].nr for el in mesh.Elements(ng.BND)]
    active[mesh.nv + np.array(boundary)] = True  # (2.4): what linear functions of x need
    return ng.Compress(full, active_dofs=ng.BitArray(np.tile(active, 2)))


@dataclass(frozen=True, eq=False)
class BoundaryTrace:
    """Segments of the whole boundary, k of them, each from s = 0 to s = 1.

    Methods take places as numbers of segments and parameters s on them.
    """

    corners: ClassVar[list[int]] = [0, -1]  # which of the nodes of a segment are vertices
    vertices: ClassVar[Array] = np.array([0.0, 1.0])  # (2,), their parameters
    mesh: ng.Mesh
    arrays: MeshArrays  # of the mesh as it was
    space: ng.FESpace  # scalar H1, whose unknowns number the nodes
    order: int  # degree of the displacement on a segment
    geometry_order: int  # degree of the curve of a segment
    region: Index  # (k,), boundary region number
    nodes: Index  # (k, order + 1), numbers from s = 0 to s = 1
    functions: Index  # (k, order + 1), NGSolve's unknowns, in its order
    element: Index  # (k,), the triangle that the segment belongs to
    body: Index  # (k,), material region number of that
    inner: Mask  # (k,), between two triangles: lines inside a body
    curve: Array  # (k, geometry_order + 1, 2), at its Gauss-Lobatto points
    side: Array  # (k,), +1 where the outward normal lies right of the direction of s, else -1
    edges: list[CadEdge] | None  # by region number, of plane bodies
    drawn: bool  # whether a geometry has the corners
    model: Model  # with the measure of segments
    axis: Index  # (k,), -1 or 1 where s = 0 or s = 1 alone lies on the axis of revolution, else 0
    on_axis: Mask  # (k,), segments that lie on it
    bernstein: Mask  # (n,), nodes whose unknown is a Bernstein coefficient, of solids
    _guides: dict[str, tuple[Index, Array]] = field(default_factory=dict, init=False)
    _masks: dict[str, Mask] = field(default_factory=dict, init=False)
    pieces: dict[Any, Any] = field(default_factory=dict, init=False)  # that `divided` has found

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again from the mesh: lines of a drawing cannot be pickled."""
        return type(self).of, (self.mesh, self.order, self.model, self.bernstein)

    @classmethod
    def of(
        cls, mesh: ng.Mesh, order: int, model: Model, bernstein: Mask | None = None
    ) -> BoundaryTrace:
        """The trace of a mesh; unknowns at nodes `bernstein` (n,) are Bernstein coefficients."""
        view, space = MeshArrays(mesh), ng.H1(mesh, order=order)
        nodes, degree, d = view.facets, max(1, mesh.GetCurveOrder()), view.dim
        curve = corners = view.vertices[nodes]
        functions = nodes
        if order > 1:
            functions = np.array([el.dofs for el in space.Elements(ng.BND)], dtype=np.intp)
            nodes = cls._numbered(nodes, functions)
        if degree > 1:
            places = list(zip(*cls.barycentric(cls.nodes_of(degree))[:-1], strict=True))
            rule = ng.IntegrationRule(places, [1.0] * len(places))
            curve = np.asarray(POSITION(mesh.MapToAllElements(rule, ng.BND)))[:, :d]
            curve = curve.reshape(len(nodes), len(places), d)
        element, edges = view.facet_elements, cad_edges(mesh)
        inwards = view.vertices[view.elements[element]].mean(axis=1) - corners[:, 0]
        normal = rightward(*(corners[:, 1:] - corners[:, :1]).transpose(1, 0, 2))
        axis = model.on_axis(curve.reshape(-1, d)).reshape(len(nodes), -1)
        return cls(
            mesh=mesh,
            arrays=view,
            space=space,
            order=order,
            geometry_order=degree,
            region=view.boundaries,
            nodes=nodes,
            functions=functions,
            element=element,
            body=view.bodies[element],
            inner=view.inner_facets,
            curve=curve,
            side=np.where((inwards * normal).sum(axis=1) > 0, -1.0, 1.0),
            edges=edges,
            drawn=edges is not None or (d == 3 and cad_faces(mesh) is not None),
            model=model,
            axis=axis[:, -1].astype(np.intp) - axis[:, 0],
            on_axis=np.asarray(axis.all(axis=1)),
            bernstein=np.zeros(space.ndof, dtype=bool) if bernstein is None else bernstein,
        )

    @staticmethod
    def nodes_of(degree: int) -> Array:
        """Parameters (q,) of the nodes of a curve of a degree."""
        return gauss_lobatto(degree)

    @staticmethod
    def barycentric(s: Array) -> list[Array]:
        """Both barycentric coordinates (k,) of places `s` (k,); NGSolve knows the first."""
        return [1 - s, s]

    @staticmethod
    def _numbered(ends: Index, functions: Index) -> Index:
        """Numbers (k, q) of nodes by vertices (k, d) and NGSolve's unknowns `functions` (k, q)."""
        inner = functions[:, 2:]  # from the end with the lower number; after both ends
        inner = np.where((ends[:, 0] < ends[:, 1])[:, None], inner, inner[:, ::-1])
        return np.column_stack([ends[:, 0], inner, ends[:, 1]])

    def point(self, segment: Index, s: Array) -> Array:
        """Points (k, 2) of the mesh's curves at parameters `s` (k,) of segments `segment` (k,)."""
        return at(self.curve, segment, s)

    def derivative(self, segment: Index, s: Array) -> Array:
        """Derivatives (k, 2) with respect to s, at `s` (k,) of segments `segment` (k,)."""
        return slope(self.curve, segment, s)

    def area_vector(self, segment: Index, s: Array) -> Array:
        """Outward normals (k, 2) as long as dx/ds times `measure` at `s` (k,) of `segment` (k,)."""
        vectors = -across(self.derivative(segment, s)) * self.side[segment, None]
        return vectors * self.measure(segment, s)[:, None] if self.model.extent else vectors

    def surface_element(self, segment: Index, s: Array) -> Array:
        """Size (k,) of the body, per unit weight of a rule, at `s` (k,) of `segment` (k,)."""
        return np.linalg.norm(self.area_vector(segment, s), axis=1)

    def rule(self, degree: int) -> tuple[Array, Array]:
        """Parameters (g,) and weights (g,) on a segment, exact for polynomials of a `degree`."""
        return gauss(degree)

    def normal(self, segment: Index, s: Array) -> Array:
        """Outward unit normals (k, d) of the mesh at `s` (k, ...) of segments `segment` (k,)."""
        return self.outward(segment, self.derivative(segment, s))

    def outward(self, segment: Index, slope: Array) -> Array:
        """These normals (k, 2) of `segment` (k,), by the derivatives `slope` (k, 2) there."""
        return rightward(slope) * self.side[segment, None]

    def _feet(
        self, segment: Index, points: Array, s: Array
    ) -> Iterator[tuple[CadEdge | CadFace, Index | Mask, Array, bool]]:
        """CAD curves or faces, and feet of `points` (k, d) near `s` (k,), as of `feet_on_faces`."""
        regions, edges = self.region[segment], self.edges or []
        for region in set(regions.tolist()) if edges else ():
            edge, here = edges[region], regions == region
            t = np.array([edge.start]) if edge.straight else edge.project(points[here])
            yield edge, here, t, edge.straight

    def exact_normal(self, segment: Index, s: Array) -> Array:
        """Normals (k, d) of CAD, without it of the mesh, at `s` (k,) of segments `segment` (k,)."""
        normals = self.normal(segment, s)
        for drawn, here, t, _ in self._feet(segment, self.point(segment, s), s):
            exact = drawn.normal_at(t)
            outward = (exact * normals[here]).sum(axis=1) >= 0
            normals[here] = np.where(outward[:, None], exact, -exact)
        return normals

    def guide(self, pattern: str) -> tuple[Index, Array]:
        """Numbers (n,) of points at nodes of a pattern, and their exact normals (m, 2); kept."""
        if pattern not in self._guides:
            segments = self.segments(pattern)
            segment, s = self.at_nodes(segments)
            normal = self.exact_normal(segment, s)
            node = self.nodes[segments].ravel()
            self._guides[pattern] = self.number_points(segment, node, normal)
        return self._guides[pattern]

    def beyond_cad(self, segment: Index, points: Array) -> Array:
        """Distance (k,) of `points` (k, d) beyond the CAD curves of segments `segment` (k,).

        Negative within the body; infinite at straight curves, plane faces and without CAD.
        """
        beyond = np.full(len(points), np.inf)
        middle = self.vertices.mean(axis=0)[None].repeat(len(segment), axis=0)
        outward = self.normal(segment, middle)
        for drawn, here, t, straight in self._feet(segment, points, middle):
            if not straight:
                normal = drawn.normal_at(t)
                normal *= np.sign((normal * outward[here]).sum(axis=1))[:, None]
                beyond[here] = ((points[here] - drawn.point(t)) * normal).sum(axis=1)
        return beyond

    def at_nodes(self, segments: Index) -> tuple[Index, Array]:
        """Segment (n,) and s (n,) of all nodes of `segments` (k,), one segment after the other."""
        s = self.places(segments)
        return segments.repeat(s.shape[1]), s.reshape(-1, *s.shape[2:])

    def at_places(self, segments: Index, s: Array) -> tuple[Index, Array]:
        """Segment (n,) and s (n,) of the places `s` (g,) on each of `segments` (k,), in order."""
        places = s[None].repeat(len(segments), axis=0)
        return segments.repeat(len(s)), places.reshape(-1, *s.shape[1:])

    def places(self, segments: Index) -> Array:
        """Parameters (k, order + 1) of the nodes of `segments` (k,)."""
        return np.array([gauss_lobatto(self.order, end) for end in (0, 1, -1)])[self.axis[segments]]

    def shapes(self, segment: Index, s: Array) -> Array:
        """Basis functions (k, order + 1) of the nodes, at `s` (k,) of segments `segment` (k,)."""
        values, axis = lagrange(self.order, s), self.axis[segment]
        for end in (-1, 1) if axis.any() else ():
            values[axis == end] = lagrange(self.order, s[axis == end], end)
        return values

    def weighs(self, segments: Index) -> Mask:
        """Nodes (k, q) of `segments` (k,) whose basis functions have a positive integral there."""
        return np.ones((len(segments), self.nodes.shape[1]), dtype=bool)

    def measure(self, segment: Index, s: Array) -> Array:
        """Measure of the body over length, (k,), at `s` (k,) of segments `segment` (k,)."""
        if not self.model.extent:
            return np.ones(len(segment))
        return self.model.measure(self.point(segment, s))

    def lengths(self, segments: Index) -> Array:
        """Lengths (k,) of the chords of `segments` (k,)."""
        return np.linalg.norm(self.curve[segments, -1] - self.curve[segments, 0], axis=1)

    def sizes(self, segments: Index) -> Array:
        """Measures (k,) of the straight `segments` (k,): lengths, in space areas."""
        return self.lengths(segments)

    def nodal_basis(self, segments: Index) -> sp.csr_array:
        """Matrix (n, n) from unknowns at the nodes of `segments` (k,), and others, to NGSolve's."""
        size, d = self.space.ndof, self.model.dim
        if self.order == 1 or not len(segments):
            return sp.eye_array(size, format="csr")
        # Segments with a common edge have equal entries there: each function once.
        functions = self.functions[segments, d:]
        rows, at = np.unique(functions, return_index=True)
        at, place = np.divmod(at, functions.shape[1])
        entries = self._functions_by_unknowns(segments)[at, place]
        kept = np.abs(entries) > ENTRY_ROUND_OFF
        count = np.ones(size + 1, dtype=np.int32)  # of entries in rows, of the identity but ...
        count[0], count[rows + 1] = 0, np.count_nonzero(kept, axis=1)
        starts = np.cumsum(count, dtype=np.int32)
        columns = np.repeat(np.arange(size, dtype=np.int32), count[1:])
        values = np.ones(len(columns))
        places = (starts[rows, None] + np.cumsum(kept, axis=1) - 1)[kept]  # ... there
        columns[places], values[places] = self.nodes[segments[at]][kept], entries[kept]
        return sp.csr_array((values, columns, starts), (size, size))

    def _functions_by_unknowns(self, segments: Index) -> Array:
        """Coefficients (k, q, q) of NGSolve's functions but the first d, by unknowns at nodes.

        Phi^-1, with Phi the functions at the nodes; the order of vertices decides which they are.
        """
        order = self.nodes[segments][:, self.corners].argsort(axis=1)[:, :2] @ [3, 1]
        kind = (3 * order + self.axis[segments]).tolist()
        found, values = {k: i for i, k in enumerate(kind)}, []  # a segment of each kind
        for i in segments[list(found.values())]:
            shape = self.space.GetFE(ng.ElementId(ng.BND, int(i)))
            points = zip(*self.barycentric(self.places(i[None])[0])[:-1], strict=True)
            values.append([shape.CalcShape(*x).NumPy() for x in points])
        number = {k: n for n, k in enumerate(found)}
        return np.linalg.inv(values)[[number[k] for k in kind], self.model.dim :]

    def linear(self, segments: Index) -> sp.csr_array:
        """Functions of degree 1, (n, nv), by nodes of `segments` (k,); those of edges add."""
        n, vertices = self.space.ndof, self.mesh.nv
        size = self.model.dim
        shares = np.stack(self.barycentric(self.places(segments)), axis=-1)
        shares = self.unknowns_of_values(segments, shares)
        inner = self.nodes[segments] >= vertices
        rows, first = np.unique(self.nodes[segments][inner], return_index=True)
        rows = np.concatenate([np.arange(vertices), np.repeat(rows, size)])
        ends = np.repeat(self.nodes[segments][:, self.corners], inner.sum(axis=1), axis=0)[first]
        columns = np.concatenate([np.arange(vertices), ends.ravel()])
        values = np.concatenate([np.ones(vertices), shares[inner][first].ravel()])
        return from_triplets(values, rows, columns, (n, vertices))

    def positions(self, segments: Index) -> Array:
        """The position as a function, (k, q, d): its unknowns at the q nodes of `segments` (k,)."""
        points = self.point(*self.at_nodes(segments))
        points = points.reshape(*self.nodes[segments].shape, points.shape[1])
        return self.unknowns_of_values(segments, points)

    def unknowns_of_values(self, segments: Index, values: Array) -> Array:
        """Unknowns (k, q, ...) of functions of `values` (k, q, ...) at nodes of `segments` (k,)."""
        return values

    def lies_on(self, segment: Index | slice, *patterns: str | None) -> Mask:
        """Mask (k,) of `segment` (k,) on boundaries that patterns select; None selects none."""
        known = self._masks
        for pattern in patterns:
            if pattern is not None and pattern not in known:
                known[pattern] = boundary_mask(self.mesh, pattern)[self.region]
        chosen = [known[pattern] for pattern in patterns if pattern is not None]
        if len(chosen) == 1:
            return chosen[0][segment]
        return np.any([np.zeros(len(self.region), dtype=bool), *chosen], axis=0)[segment]

    def segments(self, *patterns: str | None) -> Index:
        """Segments (j,) of the boundaries that the patterns select, as in `lies_on`."""
        return self.lies_on(slice(None), *patterns).nonzero()[0]

    @cached_property
    def curved_segments(self) -> Mask:
        """Segments (k,) that leave their chords, facets the planes of their vertices."""
        shares = np.stack(self.barycentric(self.nodes_of(self.geometry_order)), axis=-1)
        off = np.abs(self.curve - shares @ self.curve[:, self.corners]).max(axis=(1, 2))
        return np.asarray(off > CURVED_DISTANCE * self.lengths(np.arange(len(self.curve))))

    @cached_property
    def curved_elements(self) -> Mask:
        """Elements (ne,) with a curved side."""
        if self.geometry_order == 1:
            return np.zeros(self.mesh.ne, dtype=bool)
        view, bent = self.arrays, self.curved_segments
        curved = np.bincount(self.element[bent], minlength=self.mesh.ne) > 0
        if self.inner[bent].any():  # between two elements
            sides = view.keys(view.sides)
            curved |= np.isin(sides, view.keys(view.facets[bent])).any(axis=1)
        return np.asarray(curved)

    @cached_property
    def _corners(self) -> NDArray:
        return self.mesh.MapToAllElements(ng.IntegrationRule([(0, 0, 0)], [1]), ng.BND)

    def evaluate(self, function: ng.CoefficientFunction, segment: Index, s: Array) -> Array:
        """Values (k, dim) of a CoefficientFunction at `s` (k,) of segments `segment` (k,)."""
        points = self._corners[segment]
        for axis, x in zip("xyz", self.barycentric(s)[:-1], strict=False):
            points[axis] = x
        return np.asarray(function(points)).reshape(len(segment), function.dim)

    def traction(self, stress: ng.CoefficientFunction, segment: Index, s: Array) -> Array:
        """Traction (k, d) of a `stress` (d, d), by the mesh, at `s` (k,) of `segment` (k,)."""
        sigma = self.evaluate(ng.BoundaryFromVolumeCF(stress), segment, s)
        normal = self.normal(segment, s)
        return (sigma.reshape(*normal.shape, normal.shape[1]) @ normal[:, :, None])[..., 0]

    def _corner(self, first: Index, second: Index, turn: Array) -> Mask:
        """Whether pairs of segments (k,) at a node are corners; their normals differ by `turn`."""
        if self.drawn:
            return turn > CORNER
        names = np.array(self.mesh.GetBoundaries())
        named = names[self.region[first]] != names[self.region[second]]
        return (turn > CORNER_WITHOUT_CAD) | (named & (turn > CORNER))

    def number_points(self, segment: Index, node: Index, vector: Array) -> tuple[Index, Array]:
        """Number the nodes of several segments: a point each, at corners one for each side.

        Points (k,) of `node` (k,) on `segment` (k,), where shared nodes occur several times; and a
        unit vector (m, d) of each point, the mean by segment length or area of `vector` (k, d),
        such as the normal there: the forces of a uniform pressure on all segments add up along it.
        Segments at a node are on one side where vectors are linked by angles that make no corner.
        """
        order = np.lexsort((self._grouped(segment), node))
        _, first, size = np.unique(node[order], return_index=True, return_counts=True)
        number, count = np.empty(len(node), dtype=np.intp), len(first)
        number[order] = np.repeat(np.arange(count), size)
        one = order[first][number]  # of the segments at the node
        turn = np.linalg.norm(vector - vector[one], axis=1)
        for i in np.unique(number[self._corner(segment[one], segment, turn)]):
            at = order[first[i] : first[i] + size[i]]
            for k in range(1, size[i]):
                before, each = at[:k], np.repeat(at[k], k)
                turn = np.linalg.norm(vector[each] - vector[before], axis=1)
                linked = before[~self._corner(segment[before], segment[each], turn)]
                number[at[k]] = number[linked[0]] if linked.size else count
                count += not linked.size
        mean = np.zeros((count, self.model.dim))
        np.add.at(mean, number, vector * self.sizes(segment)[:, None])
        return number, mean / np.linalg.norm(mean, axis=1)[:, None]

    def _grouped(self, segment: Index) -> Index:
        """Keys (k,) by which those of `segment` (k,) at one node are looked at in order."""
        return np.arange(len(segment))


def prescribed_components(problem: Problem, trace: BoundaryTrace) -> Mask:
    """Components of the displacement that Gamma_u prescribes on each segment, (d, k)."""
    supports, every = problem.displacement.items(), slice(None)
    given = ((k for k, u in supports if u[axis] is not None) for axis in range(problem.dim))
    return np.array([trace.lies_on(every, *patterns) for patterns in given])


@dataclass(frozen=True, eq=False)
class BoundaryCorners:
    """Vertices at which two outer segments of a plane body meet, j of them."""

    vertex: Index  # (j,)
    sides: Index  # (j, 2), the segments
    angle: Array  # (j,), of the body, by the normals of the geometry, radians


def boundary_corners(trace: BoundaryTrace) -> BoundaryCorners:
    """All vertices of the outer boundary but those in which a body touches itself."""
    outer = np.flatnonzero(~trace.inner)
    ends = trace.nodes[outer][:, trace.corners].ravel()
    order = np.argsort(ends, kind="stable")
    vertex, start, count = np.unique(ends[order], return_index=True, return_counts=True)
    vertex, start = vertex[count == 2], start[count == 2]
    sides = np.repeat(outer, 2)[order][start[:, None] + [0, 1]]
    at_end = (trace.nodes[sides][..., -1] == vertex[:, None]).astype(float)
    normals = trace.exact_normal(sides.ravel(), at_end.ravel()).reshape(-1, 2, 2)
    turn = np.arccos(np.clip(normals.prod(axis=1).sum(axis=1), -1, 1))
    inwards = trace.arrays.angles[vertex] > np.pi  # that of the mesh is near
    return BoundaryCorners(vertex, sides, np.pi + np.where(inwards, turn, -turn))


@dataclass(frozen=True, eq=False)
class Bodies:
    """The connected bodies, b of them."""

    names: list[str]  # the material region of each
    middle: Array  # (b, d), of its boundary
    size: Array  # (b,), half its extent, a length
    of_segment: Index  # (q,), the body of each segment of the boundary
    of_vertex: Index  # (nv,), the body of each vertex of the mesh


def connected_bodies(trace: BoundaryTrace) -> Bodies:
    """The connected pieces of the mesh of `trace`."""
    piece = trace.arrays.pieces
    pieces, number = np.unique(piece[trace.nodes[:, 0]], return_inverse=True)
    materials = trace.mesh.GetMaterials()
    material, d = np.zeros(len(pieces), dtype=np.intp), trace.model.dim
    material[number] = trace.body
    ends = [trace.curve[number == b].reshape(-1, d) for b in range(len(pieces))]
    return Bodies(
        names=[materials[k] for k in material.tolist()],
        middle=np.array([(x.min(axis=0) + x.max(axis=0)) / 2 for x in ends]),
        size=np.array([np.ptp(x, axis=0).max() / 2 for x in ends]),
        of_segment=number,
        of_vertex=np.searchsorted(pieces, piece),
    )
