"""Pictures of solids: bodies cut open with a field, pressure on its surface and along the cuts."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import Array
from ..solved import Solved
from .files import check_path
from .nodes import nodes_of, order_of, sized, through
from .pictures import (
    COLOURS,
    DIVERGING,
    POWERS,
    SEQUENTIAL,
    colour_bar,
    colour_limits,
    finish_pressures,
    new_figure,
    show,
)
from .scene import AXES, STRAIGHT, Field, Style, moved_nodes
from .surface import ContactSurface, contact_surface

if TYPE_CHECKING:
    import pyvista
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# To the viewer, a little from above, so that no axis lies across; upwards.
FRONT, UP = np.array([-0.45, -1.0, 0.05]), np.array([0.0, 0.0, 1.0])
# Components of the view on a cut: upwards, or to the front where a cut looks up or down, and along
# the normals of the other cuts.
TILT, TURN = 0.35, 0.45
# Cosine between the force and the normal of a plane of symmetry, up to which it cuts the zone; also
# the length of a mean of unit normals, below which they cancel.
FORCE_COSINE = 0.5
VERTICAL_COSINE = 0.5  # of the normal of a cut, up to which the view on it is from above
PIXELS = 1000  # of the longer side of an image
ZONE_MARGIN = 0.4  # margin beside a contact zone over half its size
CLOSE_UP_SIZE = 0.2  # half-size of a zone over that of the bodies, up to which it has a close-up
NEAR_AXIS = 0.999  # cosine from which an axis is named after a coordinate: 2.6 degrees
LEAST_SIZE = 0.02  # least half-size of a zone, over that of the surface
SUBDIVISIONS = 2  # of curved elements, each of which halves their sides
DRAWN_EDGE_ANGLE = 40  # degrees between faces, from which their edge is drawn
PRESSURE_COLOURS = "YlOrRd"
# Little shading: surfaces have the colours of the scale.
LIGHT: dict[str, Any] = {"ambient": 0.75, "diffuse": 0.3, "specular": 0.0}


class Cut(NamedTuple):
    """A plane that cuts the bodies open, or of symmetry."""

    point: Array  # (3,)
    normal: Array  # (3,), outward
    symmetry: bool  # whether it is of symmetry, and bounds the bodies


class Zone(NamedTuple):
    """The contact zone of a pair, and the planes that cut it."""

    surface: ContactSurface
    mesh: pyvista.PolyData  # the same as triangles, with the pressure at the nodes
    middle: Array  # (3,), on it and in planes of symmetry that cut it, a length
    half: float  # half-size, a length
    frame: Array  # (3, 3), rows: two tangents, along axes where possible, and the normal
    cuts: list[Cut]  # those that face the viewer first


def plot_solids(
    solution: Solved,
    path: str | os.PathLike[str] | None = None,
    scale: float | None = None,
    **options: Any,
) -> Figure:
    """Picture of solids, cut open, and of the pressure; see `Solution.plot`."""
    style = Style(scale, **options)
    if style.mirror is not None:
        raise ValueError(f'mirror = "{style.mirror}": solids are not mirrored; leave it out')
    target, shown = None if path is None else check_path(path, ".png"), style.shown(solution)
    forces = [float(pair.force.sum()) if pair.gap.size else -np.inf for pair in solution.pairs]
    pair, pairs = int(np.argmax(forces)) if forces else 0, solution.problem.contact
    zone = _zone(solution, pair) if len(solution.points) else None
    figure = new_figure(target, figsize=(12, 9.5 if zone else 6))
    close = zone is not None and zone.half < CLOSE_UP_SIZE * float(np.ptp(zone.surface.trace.curve))
    parts = figure.subplot_mosaic(("bc;ps" if close else "bb;ps") if zone else "b")
    _draw_bodies(figure, parts, solution, style, shown, zone)
    if zone is not None:
        name = pairs[pair].secondary
        if len(pairs) > 1:
            name += f"\npair {pair}, of {len(pairs)} that of the largest force"
        _draw_pressure(figure, parts["p"], style, zone, name)
        for k, line in enumerate(solution.transitions(pair)):
            seen = line @ zone.frame[:2].T / style.unit("length")[1]
            parts["p"].plot(*seen.T, color=COLOURS[0], lw=2, label="" if k else "end of contact")
            parts["p"].legend()
        _draw_profiles(parts["s"], style, zone)
    show(figure, target)
    return figure


def _zone(solution: Solved, pair: int) -> Zone:
    """The contact zone of one pair; its whole surface where no point is in contact."""
    import pyvista

    surface, state = contact_surface(solution, pair), solution.pairs[pair]
    touches = state.active if state.active.any() else np.ones(state.gap.size, dtype=bool)
    weight, place = np.where(touches, state.line.weight, 0.0), state.line.position
    middle, d = (weight @ x / weight.sum() for x in (place, state.line.direction))
    if np.linalg.norm(d) < FORCE_COSINE:  # on closed surfaces normals cancel: their front
        d = state.line.direction[np.argmax(state.line.direction @ FRONT)]
    size, cuts = float(np.ptp(surface.points, axis=0).max()), []
    for point, normal in _symmetry_planes(solution, STRAIGHT * size):
        if np.abs((surface.points - point) @ normal).min() <= STRAIGHT * size:
            cuts.append(Cut(point, normal, True))
            if abs(normal @ d) < FORCE_COSINE * np.linalg.norm(d):
                middle = middle - ((middle - point) @ normal) * normal
                d = d - (d @ normal) * normal
    cuts.sort(key=lambda cut: -float(cut.normal @ FRONT))
    one, other = np.eye(3)[np.sort(np.argsort(np.abs(d), kind="stable")[:2])]
    first = one - (one @ d) / (d @ d) * d
    second = np.cross(d, first)
    frame = np.array([first, second * np.copysign(1.0, second @ other), np.zeros(3)])
    frame[:2] /= np.linalg.norm(frame[:2], axis=1)[:, None]
    frame[2], surface = np.cross(*frame[:2]), surface.looking(d)
    mesh = pyvista.PolyData(surface.points, faces=sized(surface.triangles))
    mesh["pressure"] = surface.pressure(solution)
    _, middle = mesh.find_closest_cell(middle, return_closest_point=True)  # of two zones on one
    half = float(np.linalg.norm(place[touches] - middle, axis=1).max())
    cuts = cuts or [
        Cut(middle, axis * np.copysign(1.0, axis @ FRONT), False) for axis in frame[1::-1]
    ]
    return Zone(surface, mesh, middle, max(half, LEAST_SIZE * size), frame, cuts)


def _symmetry_planes(solution: Solved, slack: float) -> list[tuple[Array, Array]]:
    """A point (3,) and the outward normal (3,) of each plane on which bodies slide."""
    trace = solution.discrete.space.trace
    facets = trace.segments(solution.problem.guide)
    found: list[tuple[Array, Array]] = []
    for region in np.unique(trace.region[facets]):
        some = facets[trace.region[facets] == region]
        points = trace.curve[some].reshape(-1, 3)
        _, place = trace.at_nodes(some[:1])
        normal = trace.normal(some[:1], place[:1])[0]
        known = any(np.abs((points - x) @ n).max() <= slack for x, n in found)
        if np.abs((points - points[0]) @ normal).max() <= slack and not known:
            found.append((points[0], normal))
    return found


def _draw_bodies(
    figure: Figure,
    parts: dict[str, Axes],
    solution: Solved,
    style: Style,
    shown: Field,
    zone: Zone | None,
) -> None:
    """The bodies, cut open at the `zone`, and a close-up of it if `parts` has axes "c"."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from vtkmodules.vtkFiltersGeometry import (
        vtkDataSetSurfaceFilter,
        vtkUnstructuredGridGeometryFilter,
    )

    unit = style.unit(shown.kind)[1]
    nodes = nodes_of(solution.mesh, order_of(solution.mesh, solution.order))
    _, moved, scale = moved_nodes(solution, nodes, style)
    grid = nodes.grid(moved)
    grid.point_data["shown"] = shown.values(nodes) / unit
    edges = through(vtkUnstructuredGridGeometryFilter(), grid).extract_all_edges()
    ends = grid.get_data_range("shown")
    normals = [cut.normal for cut in zone.cuts] if zone else [FRONT]
    if zone and not zone.cuts[0].symmetry:
        grid, edges = (
            x.clip(normal=zone.cuts[0].normal, origin=zone.middle) for x in (grid, edges)
        )
    eye = normals[0] + TURN * sum(normals[1:], np.zeros(3))
    upright = np.abs(np.array(normals) @ UP).max() < VERTICAL_COSINE
    eye = eye + TILT * (UP if upright else FRONT)
    eye = eye / np.linalg.norm(eye)
    right = np.cross(UP, eye) / np.linalg.norm(np.cross(UP, eye))
    frame = np.array([right, np.cross(eye, right), eye])
    outside = vtkDataSetSurfaceFilter()
    outside.SetNonlinearSubdivisionLevel(SUBDIVISIONS)
    surface = through(outside, grid).triangulate()
    surface["shown"] = np.clip(surface["shown"], *ends)  # between nodes polynomials overshoot
    values, triangles = np.asarray(surface["shown"]), surface.faces.reshape(-1, 4)[:, 1:]
    seen = surface.points @ frame[:2].T
    windows = [(seen.min(axis=0), seen.max(axis=0))]
    if zone and "c" in parts:
        middle, half = frame[:2] @ zone.middle, (1 + 2 * ZONE_MARGIN) * zone.half
        windows.append((middle - half, middle + half))
    given = style.limits and (style.limits[0] / unit, style.limits[1] / unit)
    limits = given or colour_limits(values, triangles, seen, windows[1:])
    colours = DIVERGING if limits[0] < 0 < limits[1] else SEQUENTIAL
    meshes = [(surface, {"scalars": "shown", "cmap": colours, "clim": limits, **LIGHT})]
    ahead = 1e-3 * surface.length * eye  # lines in front of the surface
    if style.mesh:
        thin = {"color": "black" if colours == DIVERGING else "white", "opacity": 0.35}
        meshes.append((edges.translate(ahead), thin))
    others = {"boundary_edges": False, "non_manifold_edges": False, "manifold_edges": False}
    outline = surface.clean().extract_feature_edges(DRAWN_EDGE_ANGLE, **others)
    meshes.append((outline.translate(ahead), {"color": "black", "line_width": 2}))
    titles = f"deformed bodies, displacement × {scale:g}", "zone in contact"
    for name, window, title in zip("bc", windows, titles, strict=False):
        parts[name].imshow(_image(frame, window, meshes))
        parts[name].set_axis_off()
        parts[name].set_title(title)
    there = [parts[name] for name in "bc" if name in parts]
    shading = ScalarMappable(Normalize(*limits), colours)
    colour_bar(figure, shading, there, style.title(shown.label, shown.kind), values)
    for axes in there:
        axes.set_anchor("C")


def _image(
    frame: Array,
    window: tuple[Array, Array],
    meshes: list[tuple[pyvista.DataSet, dict[str, Any]]],
) -> Array:
    """Image (h, w, 3) of `meshes` with options in a `window`, rendered without a display.

    Rows of `frame` (3, 3) point to the right, upwards and to the viewer; the window is given by two
    corners (2,) in the first two.
    """
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    low, high = window
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # VTK says that there is no display
    size = np.maximum((high - low) / (high - low).max() * PIXELS, 2).astype(int)
    plotter = pyvista.Plotter(off_screen=True, window_size=size.tolist(), lighting="light kit")
    plotter.enable_parallel_projection()
    plotter.enable_anti_aliasing("ssaa")
    for mesh, options in meshes:
        if mesh.n_points:
            plotter.add_mesh(mesh, show_scalar_bar=False, **options)
    depth, far = meshes[0][0].points @ frame[2], 2 * meshes[0][0].length
    focus = np.array([*(low + high) / 2, depth.mean()]) @ frame
    plotter.camera_position = [focus + far * frame[2], focus, frame[1]]
    plotter.camera.parallel_scale = float(high[1] - low[1]) / 2
    plotter.renderer.ResetCameraClippingRange()
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    vtkLogger.SetStderrVerbosity(verbosity)
    return image


def _name(axis: Array, other: str) -> str:
    """Name of the coordinate that an `axis` (3,) nearly has, or `other`."""
    along = np.flatnonzero(np.abs(axis) > NEAR_AXIS)
    return AXES[along[0]] if along.size else other


def _draw_pressure(figure: Figure, axes: Axes, style: Style, zone: Zone, name: str) -> None:
    """The pressure on the surface of `name`, in colours."""
    from matplotlib.collections import LineCollection
    from matplotlib.tri import Triangulation

    surface, (_, length), (_, stress) = zone.surface, style.unit("length"), style.unit("stress")
    seen, middle = (x @ zone.frame[:2].T / length for x in (surface.points, zone.middle))
    values, half = zone.mesh["pressure"] / stress, (1 + ZONE_MARGIN) * zone.half / length
    top = float(values.max(initial=0.0)) or 1.0
    drawing = {"shading": "gouraud", "cmap": PRESSURE_COLOURS, "vmin": 0.0, "vmax": top}
    shading = axes.tripcolor(Triangulation(*seen.T, surface.triangles), values, **drawing)
    if style.mesh:
        lines = list(seen[surface.edges])
        axes.add_collection(LineCollection(lines, colors="k", lw=0.4, alpha=0.2))
    ends = np.array([middle - half, middle + half]).T
    ends = np.clip(ends, seen.min(axis=0)[:, None], seen.max(axis=0)[:, None])
    ends = ends + 0.03 * np.ptp(ends, axis=1)[:, None] * [-1, 1]
    x, y = (style.title(_name(e, "along the surface"), "length") for e in zone.frame[:2])
    axes.set(aspect="equal", xlim=ends[0], ylim=ends[1], xlabel=x, ylabel=y)
    axes.set_title(f"pressure on {name}")
    axes.ticklabel_format(**POWERS)
    colour_bar(figure, shading, [axes], style.title("contact pressure", "stress"), values)


def _draw_profiles(axes: Axes, style: Style, zone: Zone) -> None:
    """The pressure along the cuts."""
    (_, length), (_, stress), data = style.unit("length"), style.unit("stress"), zone.mesh
    names, ends = [], []
    for k, cut in enumerate(zone.cuts):
        along = np.cross(cut.normal, zone.frame[2])
        along *= np.sign(along[np.argmax(np.abs(along))]) / np.linalg.norm(along)
        # A plane that bounds the surface cuts it just inside.
        inside = STRAIGHT * data.length * cut.normal if cut.symmetry else 0.0
        line = data.slice(normal=cut.normal, origin=cut.point - inside).connectivity()
        s, piece = np.asarray(line.points @ along), line.point_data["RegionId"]
        order, half = np.argsort(s), (1 + ZONE_MARGIN) * zone.half
        names.append(_name(along, f"along ({', '.join(f'{x:.2g}' for x in along.round(2) + 0.0)})"))
        apart = 1 + np.flatnonzero(np.diff(piece[order]))  # a line ends where the surface does
        drawn = (
            np.insert(x[order], apart, np.nan) for x in (s / length, line["pressure"] / stress)
        )
        axes.plot(*drawn, color=COLOURS[k], label=names[-1])
        ends += list(np.clip(zone.middle @ along + np.array([-half, half]), s.min(), s.max()))
    part = np.array([min(ends), max(ends)])
    finish_pressures(axes, style, part, dict.fromkeys(names))
    axes.set(xlim=part / length, title="contact pressure along the cuts")
    if not (data["pressure"].any() or style.profile):
        axes.set_yticks([0.0])
    axes.legend()
