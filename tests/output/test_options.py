"""What a picture shows when it is asked to: fields, units, curves, mirror images, close-ups."""

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import solve
from ngcontact.output import plot_solution
from ngcontact.output.pictures import colour_range
from ngcontact.output.scene import Style, picture
from tests.output.stubs import stub

ACROSS = 0.5  # normal to the plane


@pytest.fixture(scope="module")
def uniform():
    """A stub with one stress everywhere."""
    solution = stub(2)
    solution.stress = ng.CF((3.0, 1.0, 1.0, -2.0), dims=(2, 2))
    solution.out_of_plane_stress = ng.CF(ACROSS)
    return solution


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("stress_xx", 3.0),
        ("stress_yy", -2.0),
        ("stress_xy", 1.0),
        ("stress_zz", ACROSS),
        ("largest_principal", 0.5 + np.sqrt(2.5**2 + 1)),
        ("smallest_principal", 0.5 - np.sqrt(2.5**2 + 1)),
        ("mean_pressure", -(3.0 - 2.0 + 0.5) / 3),
        ("von_mises", np.sqrt((25 + 2.5**2 + 2.5**2) / 2 + 3)),
    ],
)
def test_fields_of_a_uniform_stress(uniform, field, value):
    scene = picture(uniform, Style(field=field))
    np.testing.assert_allclose(scene.values, value, rtol=1e-12)  # round-off
    assert scene.shown.kind == "stress"


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"field": "stress"}, ValueError, 'field = "stress"'),
        ({"field": "stress_hoop"}, ValueError, "stress_zz"),  # a plane model
        ({"field": 3}, TypeError, "field = 3"),
        ({"field": ng.CF((1, 2))}, ValueError, "2 components"),
        ({"limits": (2.0, 1.0)}, ValueError, "the smaller first"),
        ({"units": {"force": "N"}}, ValueError, '"force" is none of'),
        ({"units": {"stress": ("MPa", 0.0)}}, ValueError, "its size"),
        ({"profile": {"a": ([1, 2], [3])}}, TypeError, 'profile\\["a"\\]'),
    ],
)
def test_options_that_are_none_are_refused(tmp_path, uniform, options, error, text):
    with pytest.raises(error, match=text):
        plot_solution(uniform, tmp_path / "a.png", **options)
    assert not list(tmp_path.iterdir())


def test_a_symmetric_half_is_mirrored(pressed_half):
    half = picture(pressed_half, Style(scale=1.0))
    whole = picture(pressed_half, Style(scale=1.0, mirror="axis"))
    count = len(half.moved)
    np.testing.assert_allclose(whole.moved[count:], half.moved * (-1, 1), atol=1e-12)
    assert whole.areas().sum() == pytest.approx(2 * half.areas().sum())
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
def test_only_lines_of_symmetry_mirror(tmp_path, pressed_half, mirror, text):
    with pytest.raises(ValueError, match=text):
        plot_solution(pressed_half, tmp_path / "a.png", mirror=mirror)


def test_a_singular_corner_leaves_the_colours(tmp_path, uniform):
    """A peak r^(-1/2) at one point: colours end where all but 0.5 % of the area lie below."""
    r = ng.sqrt((ng.x + 2) ** 2 + (ng.y + 1) ** 2 + 1e-12)
    scene = picture(uniform, Style(scale=0.0, field=r**-0.5))
    low, high = colour_range(scene, [])
    # Area pi r^2 / 4 beyond the value r^(-1/2): 0.5 % of 4 + pi / 2 are r = 0.188, value 2.3; means
    # of triangles blur that.
    assert low == 0
    assert 1.8 < high < 2.8
    assert scene.values.max() > 900
    figure = plot_solution(uniform, tmp_path / "a.png", field=r**-0.5)
    [text] = [t.get_text() for axes in figure.axes for t in axes.texts if "largest" in t.get_text()]
    assert float(text.split()[1]) == pytest.approx(1000, rel=0.01)


@pytest.fixture(scope="module")
def pressed_half():
    return solve(cases.pressed_disc(), maxh=0.4, order=2)
