"""Solutions that are pickled, copied and saved say the same: what is kept, to the last bit."""

import gzip
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import ngsolve as ng
import numpy as np
import pytest

import ngcontact
from drivers.reference import cases
from ngcontact import Contact, Elastic, Hooke, adapt, solve
from tests.scenes import unmatched_blocks
from tests.solids.test_patch import blocks as cubes
from tests.solids.test_patch import pressed

ROOT = Path(__file__).parents[2]
SOFT = Elastic(E=1.0, nu=0.3)
LINE = Contact("upper_contact", "lower_contact")


def rising(x, y):
    """A gap of a function at the top of a module, which can be pickled."""
    return 0.01 + 0.02 * x + 0 * y


def two_blocks(displacement=None, **data):
    return cases.touching_blocks(displacement or {"bottom": (0, 0), "top": (0, -0.1)}, **data)


def varying():
    C = np.array([[1.2, 0.4, 0.0], [0.4, 1.2, 0.0], [0.0, 0.0, 0.4]])
    stiffer = Hooke(ng.CF(tuple((C * 2).ravel()), dims=(3, 3)) * (1 + 0.1 * ng.x))
    return two_blocks(materials={"upper": Hooke(C), "lower": stiffer})


def refined_by_hand():
    """A given mesh of which NGSolve halved some edges, and keeps them among those in use."""
    mesh = ng.Mesh(unmatched_blocks().GenerateMesh(maxh=0.5))
    for element in mesh.Elements(ng.VOL):
        mesh.SetRefinementFlag(element, mesh[element.vertices[0]].point[0] > 0.5)
    mesh.Refine()
    return two_blocks(geometry=mesh)


SCENES = {
    "pressed disc": lambda: solve(cases.pressed_disc(), maxh=0.4, order=3),
    "adapted": lambda: list(adapt(cases.partly_opening_block(), order=2, max_dofs=1500))[-1],
    "a gap function": lambda: solve(
        two_blocks(contact=[replace(LINE, gap=rising)]), maxh=0.5, order=2
    ),
    "laws": lambda: solve(varying(), maxh=0.5, order=2),
    "a mesh that NGSolve refined": lambda: solve(refined_by_hand(), order=2),
    "adapted solids": lambda: list(adapt(pressed(cubes(1, 1, width=2)), max_dofs=3000))[-1],
    "free motion": lambda: solve(
        two_blocks(displacement={"bottom": (0, 0)}, traction={"top": 0.01}), maxh=0.5
    ),
}


def kept(solution):
    """What is not computed again."""
    mesh = solution.mesh
    last = [mesh[v].point for v in mesh[ng.ElementId(ng.VOL, mesh.ne - 1)].vertices]
    names = ("points", "gap", "pressure", "active", "force", "pair", "steps", "work")
    return {
        **{name: getattr(solution, name) for name in names},
        "u": solution.displacement.vec.FV().NumPy(),
        "ends": solution.transitions() if len(solution.pairs) else 0,
        "free": len(solution.free_motions),
        "there": solution.at(np.mean(last, axis=0)).stress,
    }


@pytest.mark.parametrize("name", SCENES)
def test_a_pickled_solution_is_equal_to_the_last_bit(name):
    solution = SCENES[name]()
    again = pickle.loads(pickle.dumps(solution))
    one, other = kept(solution), kept(again)
    for key, value in one.items():
        np.testing.assert_array_equal(value, other[key], err_msg=key)
    assert str(again) == str(solution)
    assert again.mesh is again.discrete.space.trace.mesh
    # Sums of the same terms: their round-off depends on where arrays lie in memory.
    rows = [solution.record(), again.record()]
    assert rows[0].keys() == rows[1].keys()
    for names, scale in (
        (r"energy|error|energy_norm|unknowns|elements", 0.0),
        (r"contact_\d_force|reaction", max(np.abs(solution.force).max(initial=0), 1e-9)),
        (r"contact_\d_(peak|active|points)", 0.0),
    ):
        chosen = [key for key in rows[0] if re.match(names, key)]
        first, second = ([row[key] for key in chosen] for row in rows)
        np.testing.assert_allclose(first, second, rtol=1e-9, atol=1e-9 * scale, err_msg=names)
    # The estimate is made again from the geometry, whose coordinates keep 15 digits.
    assert again.error_estimate == pytest.approx(solution.error_estimate, rel=1e-8)


def test_a_saved_solution_is_read_by_another_process(tmp_path):
    solution = SCENES["pressed disc"]()
    path = solution.save(tmp_path / "disc.ngcontact")
    code = (
        f"import ngcontact; s = ngcontact.load({str(path)!r});"
        "print(s.contact_force()[1].hex(), s.pressure.max().hex(), s.gap.max().hex())"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    expected = (solution.contact_force()[1], solution.pressure.max(), solution.gap.max())
    assert result.stdout.split() == [x.hex() for x in expected]
    assert [p.name for p in tmp_path.iterdir()] == ["disc.ngcontact"]


def test_what_cannot_be_pickled_is_named(tmp_path):
    problem = two_blocks(contact=[replace(LINE, gap=lambda x, y: 0.01 + 0 * x)])
    solution = solve(problem, maxh=1.0)
    with pytest.raises(TypeError, match=r'contact\[0\].gap of "upper_contact" cannot be saved'):
        solution.save(tmp_path / "a.ngcontact")
    normal = -0.01 * ng.specialcf.normal(2)
    problem = two_blocks(displacement={"bottom": (0, 0), "top": normal})
    with pytest.raises(TypeError, match='displacement "top" cannot be saved'):
        solve(problem, maxh=1.0).save(tmp_path / "a.ngcontact")
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_no_results_are_refused(tmp_path):
    solution = solve(two_blocks(), maxh=1.0)
    with pytest.raises(ValueError, match=r"must end in '\.ngcontact'"):
        solution.save(tmp_path / "a.pkl")
    path = solution.save(tmp_path / "whole.ngcontact")
    whole = path.read_bytes()
    for name, content in (
        ("text", b"not a result"),
        ("half", whole[: len(whole) // 2]),
        ("other", gzip.compress(pickle.dumps([1, 2]))),
        ("newer", gzip.compress(pickle.dumps({"ngcontact": "9.0", "format": 99}))),
        ("unknown", gzip.compress(pickle.dumps({"ngcontact": "9.0", "format": 1}) + b"cx\ny\n.")),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match=name):
            ngcontact.load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        ngcontact.load(tmp_path / "missing.ngcontact")
