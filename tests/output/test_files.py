"""Paths and drafts of files, films, and the nodes of elements."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from vtkmodules.vtkCommonDataModel import vtkHigherOrderTriangle

from ngcontact import write_film
from ngcontact.fem import von_mises
from ngcontact.output import slope_triangle
from ngcontact.output.files import check_path, replacing
from ngcontact.output.nodes import lattice
from tests.output.stubs import stub


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_a_half_written_file_replaces_none(tmp_path, error):
    old, new = tmp_path / "old.vtu", tmp_path / "new.vtu"
    old.write_text("old")

    def interrupted():
        with replacing(old, new) as drafts:
            for draft in drafts:
                draft.write_text("half a file")
            raise error

    with pytest.raises(error):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["old.vtu"]
    assert old.read_text() == "old"


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("a.vtk", ValueError, r"must end in '\.vtu'"),
        ("a", ValueError, r"must end in '\.vtu'"),
        ("none/a.vtu", FileNotFoundError, "there is no folder .*none"),
        ("file/a.vtu", NotADirectoryError, "is not a folder"),
        ("folder.vtu", IsADirectoryError, "it is a folder"),
    ],
)
def test_bad_paths_are_refused(tmp_path, name, error, message):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.vtu").mkdir()
    with pytest.raises(error, match=message):
        check_path(tmp_path / name, ".vtu")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder.vtu"]


def test_the_last_frame_is_seen_three_times_as_long(tmp_path, monkeypatch):
    images = [Image.new("L", (8, 8), grey) for grey in (0, 100, 200)]
    monkeypatch.setattr("ngcontact.output.film._images", lambda *_: images)
    path, times = write_film(tmp_path / "a.gif", [stub(1)] * 3, seconds=0.25), []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            times.append(film.info["duration"])
    assert times == [250, 250, 750]


@pytest.mark.parametrize("above", [False, True])
def test_the_triangle_has_the_slope(above):
    axes = Figure().subplots()
    x = np.array([1e2, 1e3, 1e4])
    slope_triangle(axes, x, x**-1.5, 1.5, above)
    [line] = axes.lines
    (x0, y0), (x1, y1) = line.get_xydata()[:2]  # its long side
    assert np.log(y1 / y0) / np.log(x1 / x0) == pytest.approx(-1.5)
    assert (y1 > x1**-1.5) == above


@pytest.mark.parametrize("order", range(1, 7))
def test_node_order_is_that_of_vtk(order):
    expected = []
    for k in range((order + 1) * (order + 2) // 2):
        index = [0, 0, 0]
        vtkHigherOrderTriangle.BarycentricIndex(k, index, order)
        expected.append([index[2], index[0], index[1]])  # VTK counts from the third corner
    assert lattice(order).tolist() == expected


def test_von_mises_of_large_stresses():
    """Its squares would leave the range of numbers."""
    pull = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [2.0, 2.0, 0.0, 2.0]])
    expected = [1.0, np.sqrt(3.0), 0.0]
    for size in (1.0, 1e-200, 1e200):
        assert von_mises(size * pull) / size == pytest.approx(expected, rel=1e-15)
