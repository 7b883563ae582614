"""The pressure pi_h along a contact line, from the pressures of its points."""

import ngsolve as ng
import numpy as np
import pytest
from netgen.geom2d import SplineGeometry

from ngcontact import Contact, Elastic, Problem, solve


def on_steps(angle, **options):
    """A block pressed on a rigid obstacle with steps, all turned by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([(-0.7, 0), (0.7, 0), (0.7, 0.8), (-0.7, 0.8)]) @ [(c, s), (-s, c)]
    geometry = SplineGeometry()
    points = [geometry.AppendPoint(*corner) for corner in corners]
    for k, name in enumerate(("bottom", "right", "top", "left")):
        geometry.Append(["line", points[k], points[(k + 1) % 4]], bc=name)
    geometry.SetMaterial(1, "block")
    x = c * ng.x + s * ng.y
    problem = Problem(
        geometry=ng.Mesh(geometry.GenerateMesh(maxh=0.3)),
        materials={"block": Elastic(1.0, 0.3)},
        displacement={"top": (0.006 * s, -0.006 * c)},
        contact=[Contact("bottom", gap=ng.IfPos(ng.sin(9 * x + 0.1), 0.004, 0.001), **options)],
    )
    return solve(problem, order=2)


@pytest.mark.filterwarnings("ignore::ngcontact.ContactWarning")  # zones of one segment
@pytest.mark.parametrize("bilateral", [False, True])
def test_steps_of_a_gap_inside_segments(bilateral):
    """They are followed to round-off, where points coincide: the estimate was NaN or infinite."""
    solutions = [on_steps(angle, bilateral=bilateral) for angle in (0.3, 0.77, 2.0)]
    estimates = [solution.relative_error_estimate for solution in solutions]
    assert np.isfinite(estimates).all()
    if bilateral:
        assert min(estimates) > 0.39
    else:
        assert 0.39 < min(estimates) <= max(estimates) < 4 * 0.39
