"""Bodies of revolution: files of the whole body, pictures on both sides of the axis."""

import math
from dataclasses import replace

import numpy as np
import pytest
import pyvista

from drivers.reference import axisymmetric_cases as cases
from ngcontact import solve


@pytest.fixture(scope="module")
def pressed():
    return solve(cases.pressed_cylinders(0.5), maxh=0.5, order=2)


@pytest.mark.parametrize(("angle", "sections"), [(360.0, 60), (270.0, 46), (90.0, 16), (4.0, 4)])
def test_the_body_is_turned(tmp_path, pressed, angle, sections):
    """The volume of rings between chords of at most 6 degrees; fields turn with the body."""
    path = pressed.revolved(tmp_path / "body.vtu", angle=angle)
    grid = pyvista.read(path)
    steps = sections if angle == 360 else sections - 1
    turn = math.radians(angle)
    chords = math.sin(turn / steps) / (turn / steps)
    assert grid.volume == pytest.approx(turn / 2 * (1 - 0.25) * 2 * chords, rel=1e-9)
    assert grid.n_cells == steps * 4 * pressed.mesh.ne
    x, y, _ = grid.points.T
    u = grid["displacement"]
    assert np.abs(u[:, 0] * y - u[:, 1] * x).max() < 1e-9 * np.abs(u).max()
    assert grid["stress"].shape == (grid.n_points, 4)
    assert grid["stress"][:, 1] == pytest.approx(-1, abs=1e-9)
    assert np.abs(grid["stress"][:, [0, 2, 3]]).max() < 1e-9
    assert grid["von_mises"] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(("angle", "sections"), [(360.0, 60), (90.0, 16)])
def test_the_surface_of_contact_is_turned(tmp_path, pressed, angle, sections):
    """Its area between chords, and the pressure of 1 that pushes the upper body up."""
    pressed.revolved(tmp_path / "body.vtu", angle=angle)
    surface = pyvista.read(tmp_path / "body_contact.vtp")
    steps = sections if angle == 360 else sections - 1
    turn = math.radians(angle)
    chords = math.sin(turn / steps) / (turn / steps)
    assert surface.area == pytest.approx(turn / 2 * (1 - 0.25) * chords, rel=1e-6)  # single floats
    assert surface.n_points == sections * len(pressed.points)
    assert surface["pressure"] == pytest.approx(1, abs=1e-9)
    assert surface["traction"] == pytest.approx(np.tile([0.0, 0.0, 1.0], (surface.n_points, 1)))
    assert np.abs(surface["gap"]).max() < 1e-9
    assert surface["active"].all()
    assert list(surface.field_data["secondary_names"]) == ["upper_contact"]


def test_what_is_refused(tmp_path, pressed):
    for angle in (0, -1, 361, math.nan):
        with pytest.raises(ValueError, match="give degrees above 0, at most 360"):
            pressed.revolved(tmp_path / "body.vtu", angle=angle)
    with pytest.raises(ValueError, match=r"must end in '.vtu'"):
        pressed.revolved(tmp_path / "body.vtk")
    plane = solve(replace(cases.pressed_cylinders(), model="plane strain"), maxh=1.0)
    with pytest.raises(ValueError, match='model "plane strain": a body of revolution has'):
        plane.revolved(tmp_path / "body.vtu")
    assert list(tmp_path.iterdir()) == []
