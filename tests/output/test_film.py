"""Films and pictures of convergence."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from ngcontact import plot_convergence, write_film
from ngcontact.output import slope_triangle
from tests.output.stubs import stub


def test_the_last_frame_is_seen_three_times_as_long(tmp_path, monkeypatch):
    images = [Image.new("L", (8, 8), grey) for grey in (0, 100, 200)]
    monkeypatch.setattr("ngcontact.output.film._images", lambda *_: images)
    path, times = write_film(tmp_path / "a.gif", [stub(1)] * 3, seconds=0.25), []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            times.append(film.info["duration"])
    assert times == [250, 250, 750]


@pytest.mark.parametrize(
    ("solutions", "options", "text"),
    [
        ([], {}, "give one at least"),
        ([None], {"titles": ["a", "b"]}, "2 for 1"),
        ([None], {"seconds": 0.0}, "positive time"),
    ],
)
def test_films_that_cannot_be_are_refused(tmp_path, solutions, options, text):
    with pytest.raises(ValueError, match=text):
        write_film(tmp_path / "a.gif", solutions, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("above", [False, True])
def test_the_triangle_has_the_slope(above):
    axes = Figure().subplots()
    x = np.array([1e2, 1e3, 1e4])
    slope_triangle(axes, x, x**-1.5, 1.5, above)
    [line] = axes.lines
    (x0, y0), (x1, y1) = line.get_xydata()[:2]  # its long side
    assert np.log(y1 / y0) / np.log(x1 / x0) == pytest.approx(-1.5)
    assert (y1 > x1**-1.5) == above


def test_runs_are_drawn_with_their_rates(tmp_path):
    x = np.array([1e2, 1e3, 1e4])
    runs = {"one": (x, x**-0.5), "two": (x, 0.8 * x**-0.5)}
    figure = plot_convergence(runs, tmp_path / "a.png", rates={"one": 0.5})
    [axes] = figure.axes
    assert [line.get_label() for line in axes.lines[:1]] == ["one"]
    triangle = next(line.get_xydata() for line in axes.lines if len(line.get_xydata()) == 4)
    assert (triangle[:, 1] >= 1e-2).all()  # above, where the other run is not
    assert (tmp_path / "a.png").stat().st_size > 0
    with pytest.raises(ValueError, match="no run is called three"):
        plot_convergence(runs, tmp_path / "b.png", rates={"three": 1.0})
    with pytest.raises(ValueError, match='run "one" is empty'):
        plot_convergence({"one": []}, tmp_path / "b.png")
