"""Films and pictures of convergence."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from ngcontact import write_film
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
