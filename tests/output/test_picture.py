"""Pictures of a solution."""

import matplotlib
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.output import plot_solution
from tests.output.stubs import two_bodies


@pytest.fixture(scope="module")
def hertz():
    steel = Elastic(E=100.0, nu=0.3)
    problem = Problem(
        geometry=two_bodies(),
        materials={"disc": steel, "block": steel},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -0.02)},
        contact=[Contact("disc_arc", "block_top", direction=(0, -1))],
    )
    return solve(problem, maxh=0.3, order=2)


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
