"""Pictures of a solution: panels, fields, units, curves, mirror images, labels seen whole."""

from dataclasses import replace
from types import SimpleNamespace

import matplotlib
import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.geometries import disc_on_block
from ngcontact.geometries.region import compound
from ngcontact.output import plot_solution, write_film
from ngcontact.output.pictures import close_ups, colour_limits, cut_pressure
from ngcontact.output.scene import Style, contact_lines, picture
from tests.output.solutions import disc
from tests.scenes import rectangle


def test_singular_ends_are_cut_and_marked(tmp_path):
    """Under a punch as (1 - t^2)^(-1/2): all but a tenth lies below 2.3 of the middle's."""
    *_, solution = adapt(cases.flat_punch(), order=2, max_dofs=4000)
    top, middle = cut_pressure(picture(solution, Style())), np.abs(solution.points[:, 0]).argmin()
    assert top == pytest.approx(2 * 2.3 * solution.pressure[middle], rel=0.1)
    figure = plot_solution(solution, tmp_path / "a.png", units={"stress": ("kPa", 10.0)})
    [axes] = [a for a in figure.axes if a.get_title() == "contact pressure"]
    assert axes.get_ylim()[1] == pytest.approx(top / 10)
    assert axes.get_ylabel() == (
        f"contact pressure [kPa], largest {solution.pressure.max() / 10:.3g}"
    )


def test_contact_line_follows_an_arc():
    solution = solve(cases.ring_in_ring().problem, maxh=0.3, order=1)
    [(pair, rows, s)] = contact_lines(solution)
    angle = np.arctan2(*solution.points[rows].T)
    assert pair == 0
    assert sorted(rows) == list(range(len(solution.points)))
    assert np.all(np.diff(angle) > 0) or np.all(np.diff(angle) < 0)
    chords = 2 * np.sin(np.abs(np.diff(angle)) / 2)
    np.testing.assert_allclose(np.diff(s), chords, rtol=1e-11)
    assert s[0] == 0


@pytest.fixture(scope="module")
def hertz():
    """A whole disc on a block."""
    return solve(
        replace(
            cases.pressed_disc(),
            geometry=disc_on_block(symmetric=False),
            displacement={"block_bottom": (0, 0), "disc_top": (0, -0.02)},
            sliding=None,
        ),
        maxh=0.3,
        order=2,
    )


def test_other_peaks_are_not_cut(hertz):
    """Hertz's, a linear pressure, that of a punch with rounded corners."""
    assert cut_pressure(picture(hertz, Style())) is None
    t = hertz.points[:, 0] / np.abs(hertz.points[hertz.active, 0]).max()
    for pressure in (1 + t, 1 + 1.5 * t**8):
        other = replace(hertz)
        vars(other)["pressure"] = hertz.active * pressure
        assert cut_pressure(picture(other, Style())) is None


def test_picture_shows_bodies_and_pressure(tmp_path, hertz):
    figure = plot_solution(hertz, tmp_path / "a.png")
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]
    bodies, close, profile = figure.axes[:3]
    image = matplotlib.image.imread(tmp_path / "a.png")[:, :, :3]
    height, width = image.shape[:2]
    for axes in (bodies, close, profile):  # each panel has dark and bright pixels
        (x0, y0), (x1, y1) = axes.get_position().get_points()
        rows = slice(int((1 - y1) * height), int((1 - y0) * height))
        panel = image[rows, int(x0 * width) : int(x1 * width)]
        assert panel.std() > 0.03  # a blank panel: 0; measured: 0.1 and more
    assert (
        bodies.get_title() == "deformed bodies, displacement × 1"
    )  # contact closes a gap: true to scale
    assert close.get_xlim()[0] < 0 < close.get_xlim()[1]
    drawn = {line.get_label(): line.get_xydata() for line in profile.lines}
    points = np.column_stack([hertz.points[:, 0], hertz.pressure])
    for label, state in (("in contact", hertz.active), ("open", ~hertz.active)):
        expected = points[state][np.argsort(points[state][:, 0])]
        np.testing.assert_allclose(drawn[label], expected, atol=1e-12)


def test_bad_scale_and_suffix_are_refused(tmp_path):
    with pytest.raises(ValueError, match="scale = nan"):
        plot_solution(object(), tmp_path / "a.png", scale=float("nan"))
    with pytest.raises(ValueError, match=r"must end in '\.png'"):
        plot_solution(object(), tmp_path / "a.pdf")


NU, XX, YY, XY = 0.3, 3.0, -2.0, 1.0
ZZ = NU * (XX + YY)


@pytest.fixture(scope="module")
def uniform():
    """A square of side 2 under one stress, in plane strain, by the displacement of its sides."""
    xx, yy = ((1 - NU**2) * a - NU * (1 + NU) * b for a, b in ((XX, YY), (YY, XX)))
    xy = (1 + NU) * XY
    E = 1000.0
    problem = Problem(
        geometry=compound(rectangle("square", (0, 2), (0, 2), "side")),
        materials={"square": Elastic(E, NU)},
        displacement={"side": ((xx * ng.x + xy * ng.y) / E, (xy * ng.x + yy * ng.y) / E)},
    )
    return solve(problem, maxh=0.4, order=2)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("stress_xx", XX),
        ("stress_yy", YY),
        ("stress_xy", XY),
        ("stress_zz", ZZ),
        ("largest_principal", 0.5 + np.sqrt(2.5**2 + 1)),
        ("smallest_principal", 0.5 - np.sqrt(2.5**2 + 1)),
        ("mean_pressure", -(XX + YY + ZZ) / 3),
        ("von_mises", np.sqrt((25 + (XX - ZZ) ** 2 + (YY - ZZ) ** 2) / 2 + 3)),
    ],
)
def test_fields_of_a_uniform_stress(uniform, field, value):
    scene = picture(uniform, Style(field=field))
    np.testing.assert_allclose(scene.values, value, rtol=1e-10)  # round-off
    assert scene.shown.kind == "stress"


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"field": "stress"}, ValueError, 'field = "stress"'),
        ({"field": "stress_hoop"}, ValueError, "stress_zz"),  # a plane model
        ({"field": 3}, TypeError, "field = 3"),
        ({"field": ng.CF((1, 2))}, ValueError, "2 components"),
        ({"limits": (2.0, 1.0)}, ValueError, "the smaller first"),
        ({"units": "mm"}, TypeError, "units = 'mm': give a mapping"),
        ({"profile": np.sqrt}, TypeError, "profile = .* give a mapping"),
        ({"profile": {"a": ("x", "y")}}, TypeError, 'profile\\["a"\\]'),
        ({"units": {"force": "N"}}, ValueError, '"force" is none of'),
        ({"units": {"stress": ("MPa", 0.0)}}, ValueError, "its size"),
        ({"profile": {"a": ([1, 2], [3])}}, TypeError, 'profile\\["a"\\]'),
    ],
)
def test_options_that_are_none_are_refused(tmp_path, uniform, options, error, text):
    with pytest.raises(error, match=text):
        plot_solution(uniform, tmp_path / "a.png", **options)
    assert not list(tmp_path.iterdir())


def test_a_symmetric_half_is_mirrored():
    half = picture(disc(), Style(scale=1.0))
    whole = picture(disc(), Style(scale=1.0, mirror="axis"))
    count = len(half.moved)
    np.testing.assert_allclose(whole.moved[count:], half.moved * (-1, 1), atol=1e-12)
    np.testing.assert_array_equal(
        whole.triangles[len(half.triangles) :], half.triangles[:, ::-1] + count
    )
    inside = np.abs(whole.moved[whole.edges][..., 0]).max(axis=1) < 1e-9
    assert inside.any()
    assert not whole.outline[inside].any()  # no line along the middle


@pytest.mark.parametrize(
    ("mirror", "text"),
    [
        ("axes", "is no boundary"),
        ("disc_arc", "is not straight"),
        ("disc_top", "moves across its line"),
        ("block_top", "moves across its line"),
    ],
)
def test_only_lines_of_symmetry_mirror(tmp_path, mirror, text):
    with pytest.raises(ValueError, match=text):
        plot_solution(disc(), tmp_path / "a.png", mirror=mirror)


def test_a_singular_corner_leaves_the_colours(tmp_path, uniform):
    """A peak r^(-1/2) at one point: colours end where all but 0.5 % of the area lie below."""
    r = ng.sqrt(ng.x**2 + ng.y**2 + 1e-12)
    scene = picture(uniform, Style(scale=0.0, field=r**-0.5))
    low, high = colour_limits(scene.values, scene.triangles, scene.moved, [])
    # Area pi r^2 / 4 beyond the value r^(-1/2): 0.5 % of 4 are r = 0.16, value 2.5; means of
    # triangles blur that.
    assert low == 0
    assert 2.0 < high < 3.0
    assert scene.values.max() > 900
    figure = plot_solution(uniform, tmp_path / "a.png", field=r**-0.5)
    [label] = [a.get_ylabel() for a in figure.axes if a.get_ylabel().startswith("field, largest")]
    assert float(label.split()[-1]) == pytest.approx(1000, rel=0.01)


def test_small_zones_beside_large_ones_are_shown():
    """The zone of a roller on a beam that lies on its base all along."""
    moved = np.array([[-40.0, -30.0], [40.0, 16.0]])
    line = np.column_stack([np.linspace(-20, 20, 9), np.full(9, -10.0)])
    roller = np.column_stack([np.linspace(-0.5, 0.5, 5), np.zeros(5)])
    [(low, high)] = close_ups([SimpleNamespace(moved=moved, zones=[line, roller])])
    assert low == pytest.approx((-0.9, -0.9))
    assert high == pytest.approx((0.9, 0.9))


def test_without_contact_there_is_no_pressure_to_draw(tmp_path):
    solution = solve(replace(disc().problem, contact=[]), maxh=0.4)
    figure = plot_solution(solution, tmp_path / "a.png")
    assert not [axes for axes in figure.axes if axes.get_title() == "contact pressure"]
    assert write_film(tmp_path / "a.gif", [solution]).exists()


@pytest.mark.parametrize("move", [-0.1, 0.3])
def test_bodies_apart_are_drawn_apart_without_the_colours_of_round_off(tmp_path, move):
    """One moves by half of the gap, or away by more: twice as near it would show contact."""
    problem = Problem(
        geometry=compound(
            rectangle("lower", (0, 2), (-2, 0)), rectangle("upper", (0, 2), (0.2, 2))
        ),
        materials={"lower|upper": Elastic(E=1.0, nu=0.3)},
        displacement={"lower_bottom": (0, 0), "upper_top": (0, move)},
        contact=[Contact("upper_bottom", "lower_top")],
    )
    solution = solve(problem, maxh=0.7, order=2)
    assert ng.Integrate(ng.Norm(solution.stress), solution.mesh) > 0
    drawn = picture(solution, Style())
    assert drawn.scale == 1
    assert not drawn.values.any()
    axes = plot_solution(solution, tmp_path / "a.png").axes
    [pressure] = [one for one in axes if one.get_title() == "contact pressure"]
    assert [list(one.get_yticks()) for one in (pressure, axes[-1])] == [[0.0], [0.0]]  # no scale


def test_pairs_without_pressure_are_named(tmp_path):
    """As of a bearing's rollers, most of which carry nothing."""
    problem = disc().problem
    pairs = [*problem.contact, Contact("side", gap=1.0)]
    solution = solve(replace(problem, contact=pairs), maxh=0.4, order=2)
    figure = plot_solution(solution, tmp_path / "a.png")
    [profile] = [axes for axes in figure.axes if axes.get_title() == "contact pressure"]
    labels = [text.get_text() for text in profile.get_legend().get_texts()]
    assert labels == ["pair 0: disc_arc", "in contact", "open", "without pressure:\npair 1"]


def test_tension_of_a_bilateral_pair_is_drawn(tmp_path):
    """Three times the pressure of the other pair, on columns of one shape."""
    x, y = {"a": 0, "b": 0, "c": 3, "d": 3}, {"a": -1, "b": 0, "c": -1, "d": 0}
    bodies = [rectangle(n, (x[n], x[n] + 1), (y[n], y[n] + 1)) for n in "abcd"]
    problem = Problem(
        geometry=compound(*bodies),
        materials={"a|b|c|d": Elastic(E=1.0, nu=0.3)},
        displacement={"a_bottom|c_bottom": (0, 0), "b_top": (0, -0.01), "d_top": (0, 0.03)},
        contact=[Contact("b_bottom", "a_top"), Contact("d_bottom", "c_top", bilateral=True)],
    )
    solution = solve(problem, maxh=0.5, order=2)
    figure = plot_solution(solution, tmp_path / "a.png")
    drawn = [line.get_ydata() for axes in figure.axes for line in axes.lines]
    lowest = solution.pressure.min()
    assert lowest < -2 * solution.pressure.max()
    assert any(len(y) and np.min(y) == pytest.approx(lowest) for y in drawn)
