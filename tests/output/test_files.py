"""Paths and drafts of files, films, and the nodes of elements."""

import errno
import os
import tempfile

import numpy as np
import pytest
from PIL import Image

from drivers.reference import cases
from ngcontact import adapt, plot_convergence, write_film, write_series
from ngcontact.fem import von_mises
from ngcontact.output.files import check_path
from tests.output.solutions import disc


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("a.vtk", ValueError, r"must end in '\.vtu'"),
        ("a", ValueError, r"must end in '\.vtu'"),
        ("none/a.vtu", FileNotFoundError, "no file can be made in .*none.*No such"),
        ("file/a.vtu", NotADirectoryError, "Not a directory"),
        ("folder.vtu", IsADirectoryError, "it is a folder"),
    ],
)
def test_bad_paths_are_refused(tmp_path, name, error, message):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.vtu").mkdir()
    with pytest.raises(error, match=message):
        check_path(tmp_path / name, ".vtu")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder.vtu"]


def test_the_last_frame_is_seen_three_times_as_long(tmp_path):
    path, times = write_film(tmp_path / "a.gif", [disc()] * 3, seconds=0.25), []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            times.append(film.info["duration"])
    assert times == [250, 250, 750]


@pytest.mark.parametrize(("write", "name"), [(write_film, "a.gif"), (write_series, "a.pvd")])
def test_one_solution_is_no_series(tmp_path, write, name):
    with pytest.raises(TypeError, match="Solution: give a list of Solution"):
        write(tmp_path / name, disc())


def test_von_mises_of_large_stresses():
    """Its squares would leave the range of numbers."""
    pull = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [2.0, 2.0, 0.0, 2.0]])
    expected = [1.0, np.sqrt(3.0), 0.0]
    for size in (1.0, 1e-200, 1e200):
        assert von_mises(size * pull) / size == pytest.approx(expected, rel=1e-15)


def test_runs_are_drawn_with_their_rates(tmp_path):
    x = np.array([1e2, 1e3, 1e4])
    runs = {"one": (x, x**-0.5), "two": (x, 0.8 * x**-0.5)}
    figure = plot_convergence(runs, tmp_path / "a.png", rates={"one": 0.5})
    [axes] = figure.axes
    assert [line.get_label() for line in axes.lines[:1]] == ["one"]
    assert [len(line.get_xydata()) for line in axes.lines] == [3, 4, 3]  # one triangle
    (x0, y0), (x1, y1) = axes.lines[1].get_xydata()[:2]  # its long side
    assert np.log(y1 / y0) / np.log(x1 / x0) == pytest.approx(-0.5)
    assert y1 < x1**-0.5
    assert (tmp_path / "a.png").stat().st_size > 0
    levels = list(adapt(cases.one_transition().problem, order=1, max_dofs=1000))
    known = [(s.displacement.space.ndof, s.relative_error_bound) for s in levels[1:]]
    [axes] = plot_convergence(levels).axes
    [bound] = [line for line in axes.lines if line.get_label() == "bound"]
    assert bound.get_xydata() == pytest.approx(np.array(known))
    with pytest.raises(ValueError, match="no run is called three"):
        plot_convergence(runs, tmp_path / "b.png", rates={"three": 1.0})
    with pytest.raises(ValueError, match='run "one" is empty'):
        plot_convergence({"one": []}, tmp_path / "b.png")


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


def test_folder_that_refuses_files_is_refused(tmp_path, monkeypatch):
    def refuse(dir):  # the keyword of tempfile.TemporaryFile
        raise OSError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    with pytest.raises(PermissionError, match=r"no file can be made .*\(Permission denied\)"):
        check_path(tmp_path / "a.vtu", ".vtu")


def test_protected_file_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.vtu").write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(PermissionError, match="write-protected"):
        check_path(tmp_path / "a.vtu", ".vtu")
