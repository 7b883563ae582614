"""Panels of a picture: labels seen whole, singular peaks cut, contact lines in order."""

from types import SimpleNamespace

import ngsolve as ng
import numpy as np
import pytest
from matplotlib import pyplot

from ngcontact import Contact
from ngcontact.output import plot_solution
from ngcontact.output.pictures import cut_pressure
from ngcontact.output.scene import contact_lines
from tests.output.stubs import stub


@pytest.fixture
def solution():
    """A stub with 201 points on -1 < x < 1, none of them in contact."""
    made = stub(2)
    count = 201
    made.points = np.column_stack([np.linspace(-1, 1, count), np.zeros(count)])
    made.problem.contact = [Contact("disc_arc", "block_top", direction=(0, -1))]
    made.__post_init__()
    made.active[:] = False
    made.pressure[:], made.gap[:] = 0.0, 0.0
    return made


def touch(solution, places, width, pressure=lambda t: np.sqrt(1 - t**2)):
    """Zones of that half-width about the `places`, with that pressure over -1 < t < 1."""
    for place in places:
        t = (solution.points[:, 0] - place) / width
        inside = np.abs(t) < 1
        solution.active[inside] = True
        solution.pressure[inside] = pressure(t[inside])
    return solution


@pytest.mark.parametrize("factor", [1.0, 1e9, 1e-7])
def test_labels_lie_inside_and_apart(monkeypatch, solution, factor):
    """As drawn on the screen, where nothing is cut to fit."""
    monkeypatch.setattr(pyplot, "show", lambda: None)
    peak = ((ng.x + 2) ** 2 + (ng.y + 1) ** 2 + 1e-12) ** -0.25
    figure = plot_solution(touch(solution, [0.0], 0.5), field=factor * peak)
    figure.draw_without_rendering()
    bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    [note] = bars[0].texts
    assert "largest" in note.get_text()
    offset = bars[0].yaxis.get_offset_text()
    assert bool(offset.get_text()) == (factor != 1.0)
    labels = [a.yaxis.label for a in figure.axes] + [a.xaxis.label for a in figure.axes]
    for text in [note, offset, *labels, *(axes.title for axes in figure.axes)]:
        if text.get_text():
            box = text.get_window_extent()
            assert box.x0 >= 0
            assert box.y0 >= 0
            assert box.x1 <= figure.bbox.x1
            assert box.y1 <= figure.bbox.y1
    if offset.get_text():
        assert not note.get_window_extent().overlaps(offset.get_window_extent())
    pyplot.close(figure)


def test_singular_ends_are_cut_and_marked(tmp_path, solution):
    """(1 - t**2)**-1/2 with ends of a thousand: all but a tenth lie below 2.3."""
    touch(solution, [0.0], 0.9, lambda t: (1 - t**2) ** -0.5)
    solution.pressure[solution.active.nonzero()[0][[0, -1]]] = 1e3
    top = cut_pressure(solution)
    assert top == pytest.approx(2 * 2.3, rel=0.1)
    figure = plot_solution(solution, tmp_path / "a.png", units={"stress": ("kPa", 10.0)})
    [axes] = [a for a in figure.axes if a.get_title() == "contact pressure"]
    assert axes.get_ylim()[1] == pytest.approx(top / 10)
    assert any("largest 100" in text.get_text() for text in axes.texts)


@pytest.mark.parametrize(
    "pressure", [lambda t: np.sqrt(1 - t**2), lambda t: 1 + t, lambda t: 1 + 1.5 * t**8]
)
def test_other_peaks_are_not_cut(solution, pressure):
    """Hertz's, a linear one, that of a punch with rounded corners."""
    assert cut_pressure(touch(solution, [0.0], 0.9, pressure)) is None


def lines_of(points, direction=None, pair=None):
    contact = [SimpleNamespace(direction=direction)] * 2
    pair = np.zeros(len(points), dtype=int) if pair is None else pair
    solution = SimpleNamespace(points=points, pair=pair, problem=SimpleNamespace(contact=contact))
    return contact_lines(solution)


def test_contact_line_follows_an_arc_in_any_numbering():
    angle = np.sort(np.random.default_rng(1).uniform(0, 5.5, 60))
    shuffle = np.random.default_rng(2).permutation(60)
    points = np.column_stack([np.cos(angle), np.sin(angle)])[shuffle]
    [(pair, rows, s)] = lines_of(points)
    along = angle[shuffle][rows]
    assert pair == 0
    assert np.all(np.diff(along) > 0) or np.all(np.diff(along) < 0)
    chords = 2 * np.sin(np.abs(np.diff(along)) / 2)
    np.testing.assert_allclose(np.diff(s), chords, rtol=1e-12)
    assert s[0] == 0


def test_contact_line_keeps_both_rows_of_a_corner():
    points = np.array([[0, 0], [1, 0], [2, 0], [2, 0], [2, 1], [2, 2.0]])
    [(_, rows, s)] = lines_of(points)
    assert rows.tolist() == [0, 1, 2, 3, 4, 5]
    assert s.tolist() == [0, 1, 2, 2, 3, 4]
