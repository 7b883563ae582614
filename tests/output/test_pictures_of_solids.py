"""Pictures of solids: what is cut, where, and which pressure is drawn; options that are refused."""

import matplotlib.image
import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.output import plot_solids, write_film
from ngcontact.output.surface import contact_surface
from tests.output.solutions import PRESSURE, pressed_ball, pressed_cube
from tests.solids.meshes import boxes


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """The picture of a quarter of a ball, and the file."""
    path = tmp_path_factory.mktemp("ball") / "ball.png"
    units = {"length": ("mm", 1e-3), "stress": ("MPa", 1e-3)}
    profile = {"Hertz": lambda s: 0.1 * np.sqrt(np.maximum(0, 1 - (s / 0.3) ** 2))}
    return plot_solids(pressed_ball(), path, units=units, profile=profile), path


def panel(figure, title):
    (axes,) = (axes for axes in figure.axes if axes.get_title().startswith(title))
    return axes


def test_a_file_shows_both_cuts_and_the_pressure(ball):
    figure, path = ball
    picture = matplotlib.image.imread(path)
    assert min(picture.shape[:2]) > 800
    for title in ("deformed bodies", "pressure on ball_surface", "contact pressure along"):
        assert panel(figure, title) is not None
    (bodies,) = panel(figure, "deformed").images
    pixels = bodies.get_array()
    white = (pixels == 255).all(axis=2)
    # Bodies fill the image up to its rim, and both cuts and the background are seen.
    assert 0.05 < white.mean() < 0.6  # measured: 0.1
    assert not white.all(axis=1).any()
    assert not white.all(axis=0).any()
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 500


def test_the_pressure_is_drawn_along_the_planes_of_symmetry(ball):
    """From the axis on, along x and y, in the units asked for, with the exact profile over it."""
    figure, _ = ball
    axes = panel(figure, "contact pressure")
    x, y, hertz, _ = axes.lines
    assert [line.get_label() for line in (x, y, hertz)] == ["x", "y", "Hertz"]
    surface = contact_surface(pressed_ball(), 0)
    points, pressure = 1e3 * surface.points, 1e3 * surface.pressure(pressed_ball())
    for axis, line in enumerate((x, y)):
        s, p = line.get_data()
        on = (np.abs(points[:, 1 - axis]) < 1e-9) & (points[:, axis] < s[-1])
        assert on.sum() > 3
        assert s[0] == pytest.approx(0, abs=1e-2)
        assert np.all(np.diff(s) >= 0)
        # The line is cut beside the plane, by 1e-6 of the size.
        expected = np.interp(points[on, axis], s, p)
        np.testing.assert_allclose(pressure[on], expected, atol=1e-4 * p.max())
        assert p[-1] < 0.1 * p.max()
    np.testing.assert_allclose(
        hertz.get_ydata(),
        100 * np.sqrt(np.maximum(0, 1 - (hertz.get_xdata() / 300) ** 2)),
        rtol=1e-12,
    )
    assert axes.get_xlabel() == "x or y [mm]"
    assert panel(figure, "pressure on").get_ylabel() == "y [mm]"


@pytest.mark.parametrize("order", [2, 3])
def test_a_whole_column_is_cut_through_its_middle(order, tmp_path):
    """And shown in half; a uniform pressure is drawn as one."""
    figure = plot_solids(pressed_cube(order), tmp_path / "cube.png", field="displacement_z")
    x, y, _ = panel(figure, "contact pressure").lines
    for line in (x, y):
        s, p = line.get_data()
        np.testing.assert_allclose(p, PRESSURE, rtol=1e-9)
        np.testing.assert_allclose([s.min(), s.max()], [-0.5, 0.5], atol=1e-6)
    (surface,) = panel(figure, "pressure on cube_bottom").collections[:1]
    np.testing.assert_allclose(surface.get_array(), PRESSURE, rtol=1e-9)


def test_what_is_refused(tmp_path):
    solution, path = pressed_cube(1), tmp_path / "cube.png"
    for wrong, message in (
        ({"mirror": "cube_side"}, 'mirror = "cube_side": solids are not mirrored'),
        ({"field": "stress_hoop"}, "stress_yz, stress_xz"),
        ({"scale": np.inf}, "give a finite factor"),
    ):
        with pytest.raises(ValueError, match=message):
            solution.plot(path, **wrong)
    with pytest.raises(ValueError, match="a film"):
        write_film(tmp_path / "cube.gif", [solution])
    assert not path.exists()


@pytest.mark.parametrize("sliding", [(), ".*_bottom"])
def test_upright_faces_in_contact_are_seen_from_above(sliding, tmp_path):
    """Cut by a plane z = const, of symmetry or not, to which upwards is normal."""
    problem = Problem(
        geometry=boxes(
            ("wall", (-1, 0, 0), (0, 1, 1), (2, 2, 2)), ("slab", (0, 0, 0), (1, 1, 1), (2, 2, 2))
        ),
        materials={"wall|slab": Elastic(E=1.0, nu=0.0)},
        displacement={"wall_left": (0, 0, 0)},
        sliding=sliding,
        traction={"slab_right": PRESSURE},
        contact=[Contact("slab_left", "wall_right")],
    )
    figure = plot_solids(solve(problem, order=2), tmp_path / "a.png")
    for line in panel(figure, "contact pressure").lines[:-1]:
        np.testing.assert_allclose(line.get_ydata(), PRESSURE, rtol=1e-9)
    (image,) = panel(figure, "deformed").images
    assert 0.05 < (image.get_array() == 255).all(axis=2).mean() < 0.7  # bodies and background


def test_what_is_positive_has_no_negative_colours(tmp_path):
    """A step, between whose nodal values 0, 0, 1 the polynomials of curved cells have -1/8."""
    step = ng.IfPos(ng.x - 0.1, 1.0, 0.0)
    figure = plot_solids(pressed_ball(), tmp_path / "a.png", field=step)
    bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    assert bars[0].get_ylim() == (0, 1)
