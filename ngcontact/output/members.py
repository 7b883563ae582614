"""What a solution can be asked for on paper and on screen: members of `Solution`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import ngsolve as ng

from .pictures import Profile, Unit, plot_solution
from .revolution import write_revolved
from .solution_data import SolutionData
from .vtk import write_solution


class Shown:
    """Members of `Solution` that write and draw it."""

    def write(self: SolutionData, path: str | os.PathLike[str]) -> Path:
        """Write `path` (.vtu) and, beside it, ``<stem>_contact.vtp``."""
        return write_solution(path, self)

    def revolved(self: SolutionData, path: str | os.PathLike[str], angle: float = 270.0) -> Path:
        """Write the body of revolution, turned by `angle` degrees, to `path` (.vtu)."""
        return write_revolved(path, self, angle)

    def plot(
        self: SolutionData,
        path: str | os.PathLike[str] | None = None,
        scale: float | None = None,
        *,
        field: str | ng.CoefficientFunction = "von_mises",
        limits: tuple[float, float] | None = None,
        units: Mapping[str, Unit] | None = None,
        profile: Mapping[str, Profile] | None = None,
        mesh: bool = True,
        mirror: str | None = None,
    ) -> None:
        """Picture of the deformed bodies, close-ups of zones in contact, and the pressure.

        Parameters
        ----------
        path : path, optional
            File (.png); without one the picture is shown on the screen.
        scale : float, optional
            Factor of the displacement; chosen to be seen when left out.
        field : str or ng.CoefficientFunction
            What colours show: "von_mises", "displacement", "displacement_x", "displacement_y",
            "stress_xx", "stress_yy", "stress_xy", "stress_zz", "largest_principal",
            "smallest_principal", "mean_pressure", or a real function. Of bodies of revolution
            the coordinates are r and z, and "stress_hoop" takes the place of "stress_zz".
        limits : tuple of float, optional
            Ends of the colour scale in the unit of the data. Default: the range of the bodies and
            of the zones in contact without single peaks, as at corners; an arrow and a number on
            the scale say what lies beyond.
        units : mapping, optional
            Of "length" and "stress": a name, or a name and its size in the unit of the data, as
            ``{"length": ("mm", 1e-3), "stress": ("MPa", 1e6)}``.
        profile : mapping, optional
            What is drawn over the pressure, by label: functions of the coordinate (k,) along the
            contact line, or pairs of arrays, coordinates and pressures in the unit of the data.
        mesh : bool
            Whether edges of elements are drawn.
        mirror : str, optional
            A straight boundary, a line of symmetry, at which the bodies are mirrored. Bodies of
            revolution always are at their axis.

        Raises
        ------
        ValueError, TypeError, OSError
            An option that is none, a path that cannot be written: before any work. A boundary
            `mirror` that is no line of symmetry.
        """
        plot_solution(
            self,
            path,
            scale,
            field=field,
            limits=limits,
            units=units or {},
            profile=profile or {},
            mesh=mesh,
            mirror=mirror,
        )
