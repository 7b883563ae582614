"""Pictures of solids: bodies cut open with a field, pressure on its surface and along axes."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index
from ..reference import triangle
from ..solved import Solved
from .files import check_path
from .nodes import EDGES, FACES, Nodes, nodes_of
from .pictures import (
    COLOURS,
    POWERS,
    PROFILE_SAMPLES,
    RISING,
    SIGNED,
    Scale,
    colour_bar,
    colour_limits,
    new_figure,
    show,
)
from .scene import AXES, STRAIGHT, Field, Style, chosen_scale
from .surface import ContactSurface, contact_surface
from .vtk import VTK_CELLS

if TYPE_CHECKING:
    import pyvista
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FRONT = np.array([0.5, 1.0, 0.0])  # into the picture, from the eye
ALONG = 0.5  # cosine to the load from which a plane of symmetry does not pass through the zone
PIXELS = 1000  # of an image, along its longer side
MARGIN = 0.4  # of a zone in contact, shown beside it
SMALL = 0.2  # half of a zone's extent, relative to the bodies, from which no close-up is needed
SMALLEST = 0.02  # extent of a zone that is shown, relative to its surface
TILT, TURN = 0.35, 0.45  # of the view on a section: upwards, and to the second one
PRESSED = "YlOrRd"  # colours of pressures
CURVED = 2  # divisions of the sides of curved elements, by two each time
FLAT: dict[str, Any] = {"ambient": 0.75, "diffuse": 0.3, "specular": 0.0}  # colours as on the scale


class View(NamedTuple):
    """A parallel projection."""

    eye: Array  # (3,), unit vector to the eye
    right: Array  # (3,), on the screen
    up: Array  # (3,)

    def seen(self, points: Array) -> Array:
        """Coordinates (k, 2) on the screen of `points` (k, 3)."""
        return np.stack([points @ self.right, points @ self.up], axis=1)


def _view(eye: Array, up: Array) -> View:
    """The view from the direction `eye` (3,), with `up` (3,) upwards."""
    eye = eye / np.linalg.norm(eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return View(eye, right, np.cross(eye, right))


class Zone(NamedTuple):
    """Where a pair is in contact, and the planes that cut it."""

    pair: int
    surface: ContactSurface
    pressure: Array  # (n,), at the nodes of the surface
    direction: Array  # (3,), mean of the rows by their forces
    middle: Array  # (3,), of the forces, on planes of symmetry
    half: float  # half of its extent, a length
    view: View  # on the surface, its axes as near to those of coordinates as may be
    planes: list[tuple[Array, Array]]  # a point (3,) and the outward normal (3,), foremost first
    symmetric: bool  # whether these bound the bodies


def plot_solids(
    solution: Solved,
    path: str | os.PathLike[str] | None = None,
    scale: float | None = None,
    **options: Any,
) -> Figure:
    """Picture of solids, cut open, and of the pressure; see `Solution.plot`.

    Arguments and errors as of `plot_solution`; solids are not mirrored.
    """
    style = Style(scale, **options)
    if style.mirror is not None:
        raise ValueError(f'mirror = "{style.mirror}": solids are not mirrored; leave it out')
    target, shown = None if path is None else check_path(path, ".png"), style.shown(solution)
    _ = solution.stress  # refuses a mesh that was changed, whatever field is shown
    bodies = _bodies(solution, style, shown)
    force = {k: np.abs(p.force).sum() for k, p in enumerate(solution.pairs) if p.gap.size}
    zone = _zone(solution, max(force, key=lambda k: float(force[k]))) if force else None
    figure = new_figure(target, figsize=(12, 9.5 if zone else 6))
    if zone is None:
        parts = figure.subplot_mosaic("b")
    else:
        parts = figure.subplot_mosaic(
            "bc;ps" if zone.half < SMALL * bodies.grid.length else "bb;ps"
        )
        _draw_pressure(figure, parts["p"], solution, style, zone)
        _draw_profiles(parts["s"], style, zone)
    _draw_bodies(figure, parts, style, shown, bodies, zone)
    show(figure, target, bbox_inches="tight", pad_inches=0.05)
    return figure


def _zone(solution: Solved, pair: int) -> Zone:
    """The zone in contact of one pair; the whole surface where nothing touches."""
    surface, state = contact_surface(solution, pair), solution.pairs[pair]
    touches = state.active if state.active.any() else np.ones(state.gap.size, dtype=bool)
    weight, place = np.where(touches, state.line.weight, 0.0), state.line.position
    middle, direction = (weight @ x / weight.sum() for x in (place, state.line.direction))
    size = float(np.ptp(surface.points, axis=0).max())
    planes = []
    for point, normal in _symmetry_planes(solution, STRAIGHT * size):
        if np.abs((surface.points - point) @ normal).min() <= STRAIGHT * size:
            planes.append((point, normal))
            if abs(normal @ direction) < ALONG * np.linalg.norm(direction):
                middle = middle - ((middle - point) @ normal) * normal
                direction = direction - (direction @ normal) * normal
    direction = direction / np.linalg.norm(direction)
    planes.sort(key=lambda plane: float(plane[1] @ FRONT))
    axes = np.eye(3)[np.sort(np.argsort(np.abs(direction), kind="stable")[:2])]
    first = axes[0] - (axes[0] @ direction) * direction
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    second *= np.copysign(1.0, second @ axes[1])
    symmetric = bool(planes)
    if not symmetric:
        planes = [(middle, -second), (middle, -first)]
    half = max(float(np.linalg.norm(place[touches] - middle, axis=1).max()), SMALLEST * size)
    pressure = np.nan_to_num(_readable(surface, solution))
    view = View(np.cross(first, second), first, second)
    return Zone(pair, surface, pressure, direction, middle, half, view, planes, symmetric)


def _readable(surface: ContactSurface, solution: Solved) -> Array:
    """Pressure (n,) at the nodes: of order 2 linear between the means at vertices."""
    found = surface.values(solution.pressure)
    if surface.trace.order == 2:
        means = found[surface.nodes[:, triangle.EDGES]].mean(axis=2)
        known = np.isfinite(means)
        found[surface.nodes[:, 3:][known]] = means[known]
    # Means beside the end of contact go on below 0, where no row is.
    return np.maximum(found, min(0.0, float(solution.pressure.min())))


def _symmetry_planes(solution: Solved, slack: float) -> list[tuple[Array, Array]]:
    """A point (3,) and the outward normal (3,) of each plane on which bodies slide."""
    trace, found = solution.discrete.space.trace, []
    if solution.problem.sliding is None:
        return []
    facets = trace.segments(str(solution.problem.sliding))
    for region in np.unique(trace.region[facets]):
        some = facets[trace.region[facets] == region]
        place = np.tile(triangle.CENTRE, (len(some), 1))
        normal, points = trace.normal(some, place).mean(axis=0), trace.curve[some].reshape(-1, 3)
        off = np.abs((points - points[0]) @ normal).max()
        fresh = all(np.abs((points - x) @ n).max() > slack for x, n in found)
        if off <= slack and fresh:
            found.append((points[0], normal / np.linalg.norm(normal)))
    return found


class Bodies(NamedTuple):
    """Deformed bodies with the field."""

    grid: pyvista.UnstructuredGrid
    edges: pyvista.PolyData  # of elements on the surface
    scale: float


def _bodies(solution: Solved, style: Style, shown: Field) -> Bodies:
    """The bodies of a picture."""
    import pyvista

    order = max(solution.mesh.GetCurveOrder(), solution.order)
    nodes = nodes_of(solution.mesh, order)
    found = nodes.values(ng.CF((ng.x, ng.y, ng.z, *solution.displacement)))
    place, move = found[:, :3], found[:, 3:]
    body = np.empty(len(place), dtype=np.intp)
    body[nodes.cells] = nodes.body[:, None]
    scale = chosen_scale(solution, place, move, body) if style.scale is None else style.scale
    moved = place + scale * move
    grid = pyvista.UnstructuredGrid({VTK_CELLS[3][order - 1]: nodes.cells}, moved)
    grid.point_data["shown"] = shown.values(nodes) / style.unit(shown.kind)[1]
    return Bodies(grid, _lines(moved, _surface_edges(nodes, order)), scale)


def _surface_edges(nodes: Nodes, order: int) -> Index:
    """Nodes (e, order + 1) of the edges of elements on the surface of bodies."""
    faces = np.sort(nodes.cells[:, FACES], axis=2)
    _, back, count = np.unique(
        faces.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    outside = (count[back] == 1).reshape(faces.shape[:2])
    belongs = np.array([[set(edge) <= set(face) for edge in EDGES] for face in FACES])
    on = (outside[:, :, None] & belongs).any(axis=1)
    inner = 4 + np.arange(6 * (order - 1)).reshape(6, order - 1)
    local = np.column_stack([np.array(EDGES)[:, 0], inner, np.array(EDGES)[:, 1]])
    edges = nodes.cells[:, local][on]
    _, first = np.unique(np.sort(edges[:, [0, -1]], axis=1), axis=0, return_index=True)
    return np.asarray(edges[first])


def _surface(grid: pyvista.UnstructuredGrid) -> pyvista.PolyData:
    """The surface of curved elements as small triangles."""
    import pyvista
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(CURVED)
    surface.Update()
    return pyvista.wrap(surface.GetOutput()).triangulate()


def _lines(points: Array, lines: Index) -> pyvista.PolyData:
    """Lines (e, j) through `points` (k, 3)."""
    import pyvista

    sized = np.column_stack([np.full(len(lines), lines.shape[1]), lines])
    return pyvista.PolyData(points, lines=sized.ravel())


def _image(
    view: View, low: Array, high: Array, meshes: list[tuple[pyvista.DataSet, dict[str, Any]]]
) -> Array:
    """Image (h, w, 3) of `meshes`, with their options, between corners (2,) on the screen."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    size = np.maximum((high - low) / (high - low).max() * PIXELS, 2).astype(int)
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # without a display VTK would say so
    plotter = pyvista.Plotter(off_screen=True, window_size=size.tolist(), lighting="light kit")
    plotter.enable_parallel_projection()
    plotter.enable_anti_aliasing("ssaa")
    for mesh, options in meshes:
        if mesh.n_points:
            plotter.add_mesh(mesh, show_scalar_bar=False, **options)
    middle = (low + high) / 2
    focus = middle[0] * view.right + middle[1] * view.up
    depth = [x for mesh, _ in meshes for x in (mesh.points @ view.eye) if mesh.n_points]
    focus = focus + view.eye * (max(depth) + min(depth)) / 2
    far = 2 * (max(depth) - min(depth)) + 2 * float((high - low).max())
    plotter.camera.focal_point = tuple(focus)
    plotter.camera.position = tuple(focus + far * view.eye)
    plotter.camera.up = tuple(view.up)
    plotter.camera.parallel_scale = float(high[1] - low[1]) / 2
    plotter.renderer.ResetCameraClippingRange()
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    vtkLogger.SetStderrVerbosity(verbosity)
    return image


def _draw_bodies(
    figure: Figure,
    parts: dict[str, Axes],
    style: Style,
    shown: Field,
    bodies: Bodies,
    zone: Zone | None,
) -> None:
    """The bodies, cut open at the `zone`, and that close up if there is a part for it."""
    grid, edges, cuts = bodies.grid, bodies.edges, [-FRONT]
    if zone is not None:
        cuts = [normal for _, normal in zone.planes]
        if not zone.symmetric:
            (point, normal), _ = zone.planes
            grid, edges = (x.clip(normal=normal, origin=point) for x in (grid, edges))
    eye = cuts[0] + TURN * sum(cuts[1:], np.zeros(3))
    if np.abs(np.array(cuts)[:, 2]).max() < ALONG:
        eye = eye + np.array([0.0, 0.0, TILT])
    view = _view(eye, np.array([0.0, 0.0, 1.0]))
    surface = _surface(grid)
    values, triangles = np.asarray(surface["shown"]), surface.faces.reshape(-1, 4)[:, 1:]
    seen = view.seen(surface.points)
    windows = [(seen.min(axis=0), seen.max(axis=0))]
    near = [np.ones(len(triangles), dtype=bool)]
    if zone is not None and "c" in parts:
        middle, half = view.seen(zone.middle[None])[0], (1 + 2 * MARGIN) * zone.half
        windows.append((middle - half, middle + half))
        apart = np.linalg.norm(surface.points[triangles].mean(axis=1) - zone.middle, axis=1)
        near.append(apart < half)
    areas = np.asarray(surface.compute_cell_sizes()["Area"])
    limits = style.limits or colour_limits(values, triangles, areas, near)
    if style.limits:
        limits = tuple(x / style.unit(shown.kind)[1] for x in style.limits)
    colours = SIGNED if limits[0] < 0 < limits[1] else RISING
    outline = surface.clean().extract_feature_edges(
        40, boundary_edges=False, non_manifold_edges=False, manifold_edges=False
    )
    ahead = 1e-3 * surface.length * view.eye
    meshes = [(surface, {"scalars": "shown", "cmap": colours, "clim": limits, **FLAT})]
    if style.mesh:
        lines = {"color": "black" if colours == SIGNED else "white", "opacity": 0.35}
        meshes.append((edges.translate(ahead), {**lines, "line_width": 1}))
    meshes.append((outline.translate(ahead), {"color": "black", "line_width": 2}))
    titles = (f"deformed bodies, displacement × {bodies.scale:g}", "zone in contact")
    for axes, (low, high), title in zip(map(parts.get, "bc"), windows, titles, strict=False):
        axes.imshow(_image(view, low, high, meshes))
        axes.set_axis_off()
        axes.set_title(title)
    drawn = _shading(limits, colours)
    ends = float(values.min()), float(values.max())
    there = [parts[name] for name in "bc" if name in parts]
    colour_bar(figure, drawn, there, Scale(style.title(shown.label, shown.kind), ends, limits))
    for axes in there:
        axes.set_anchor("C")


def _shading(limits: tuple[float, float], colours: str) -> Any:
    """What a scale of colours shows."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(*limits), colours)


def _name(axis: Array, other: str) -> str:
    """Name of the coordinate along an `axis` (3,), or `other`."""
    along = np.flatnonzero(np.abs(axis) > 1 - STRAIGHT)
    return AXES[along[0]] if along.size else other


def _draw_pressure(figure: Figure, axes: Axes, solution: Solved, style: Style, zone: Zone) -> None:
    """The pressure on its surface as colour, and the end of contact."""
    import pyvista

    surface, (_, length), (_, stress) = zone.surface, style.unit("length"), style.unit("stress")
    faces = np.column_stack([np.full(len(surface.triangles), 3), surface.triangles])
    data = pyvista.PolyData(surface.points, faces=faces.ravel())
    data.point_data["pressure"] = zone.pressure / stress
    seen, middle = zone.view.seen(surface.points), zone.view.seen(zone.middle[None])[0]
    half = (1 + MARGIN) * zone.half
    rim = 0.03 * half
    low = np.maximum(middle - half, seen.min(axis=0) - rim)
    high = np.minimum(middle + half, seen.max(axis=0) + rim)
    limits = 0.0, float(zone.pressure.max(initial=0.0)) / stress or 1.0
    meshes = [(data, {"scalars": "pressure", "cmap": PRESSED, "clim": limits, "lighting": False})]
    if style.mesh:
        order = surface.trace.order
        inner = [triangle.edge_nodes(order)[k] for k in range(3)]
        local = [[i, *between, j] for (i, j), between in zip(triangle.EDGES, inner, strict=True)]
        edges = _lines(surface.points, surface.nodes[:, local].reshape(-1, order + 1))
        ahead = 1e-3 * data.length * zone.view.eye
        meshes.append((edges.translate(ahead), {"color": "black", "opacity": 0.2}))
    image = _image(zone.view, low, high, meshes)
    axes.imshow(image, extent=(low[0], high[0], low[1], high[1]) / np.array(length))
    for number, line in enumerate(solution.transitions(zone.pair)):
        name = "end of contact" if number == 0 else None
        axes.plot(*zone.view.seen(line).T / length, color="#56B4E9", lw=2, label=name)
        axes.legend()
    names = (_name(zone.view.right, "along the surface"), _name(zone.view.up, "along the surface"))
    pair = solution.problem.contact[zone.pair].secondary
    title = f"pressure on {pair}" + (" (of the largest force)" if len(solution.pairs) > 1 else "")
    axes.set(
        xlabel=style.title(names[0], "length"), ylabel=style.title(names[1], "length"), title=title
    )
    axes.ticklabel_format(**POWERS)
    label = style.title("contact pressure", "stress")
    colour_bar(figure, _shading(limits, PRESSED), [axes], Scale(label, limits, limits))


def _draw_profiles(axes: Axes, style: Style, zone: Zone) -> None:
    """The pressure along the planes that cut the zone."""
    import pyvista

    surface, (_, length), (_, stress) = zone.surface, style.unit("length"), style.unit("stress")
    faces = np.column_stack([np.full(len(surface.triangles), 3), surface.triangles])
    data = pyvista.PolyData(surface.points, faces=faces.ravel())
    data.point_data["pressure"] = zone.pressure / stress
    names, ends = [], []
    for k, (point, normal) in enumerate(zone.planes):
        along = np.cross(normal, zone.direction)
        along /= np.linalg.norm(along)
        along *= np.sign(along[np.argmax(np.abs(along))])
        # A plane of symmetry bounds the surface, and cuts it just inside.
        inside = STRAIGHT * data.length * normal if zone.symmetric else 0 * normal
        line = data.slice(normal=normal, origin=point - inside)
        s = line.points @ along
        order, middle = np.argsort(s), zone.middle @ along
        names.append(_name(along, f"cut {k + 1}"))
        axes.plot(
            s[order] / length, line["pressure"][order], color=COLOURS[k], label=f"along {names[-1]}"
        )
        ends += [middle - (1 + MARGIN) * zone.half, middle + (1 + MARGIN) * zone.half]
        ends = [max(min(ends), float(s.min())), min(max(ends), float(s.max()))]
    for stroke, (label, profile) in zip(("--", ":", "-."), style.profile.items(), strict=False):
        s = np.linspace(*ends, PROFILE_SAMPLES)
        s, p = (s, profile(s)) if callable(profile) else map(np.asarray, profile)
        axes.plot(s / length, np.broadcast_to(p, s.shape) / stress, stroke, color="k", label=label)
    axes.set_xlim(ends[0] / length, ends[1] / length)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set(
        xlabel=style.title(" or ".join(dict.fromkeys(names)), "length"),
        ylabel=style.title("contact pressure", "stress"),
        title="pressure along the cuts",
    )
    axes.ticklabel_format(**POWERS)
    axes.grid(alpha=0.3)
    axes.legend()
