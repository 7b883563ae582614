"""Certificates pass a check that shares no code with the package; tampered ones fail."""

from __future__ import annotations

import ast
import copy
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import ngsolve as ng
import numpy as np
import pytest

from drivers import check_certificate
from drivers.reference import axisymmetric_cases, cases, laws
from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import ring_in_groove
from tests.scenes import unmatched_blocks

DRIVER = Path(check_certificate.__file__)


def dual_transition():
    case = cases.one_transition()
    return replace(case.problem, geometry=unmatched_blocks())


SCENES = {
    "transition": lambda: cases.one_transition().problem,
    "hertz": lambda: cases.hertz_contact().problem,
    "body forces": lambda: cases.clamped_transition().problem,
    "corners": lambda: cases.polygonal_patch().problem,
    "lifting off": cases.partly_opening_block,
    "punch": cases.flat_punch,
    "dual rows": dual_transition,
}


def dual_rings():
    problem = cases.ring_in_ring().problem
    return replace(problem, contact=[replace(c, rows="dual") for c in problem.contact])


BENT = {
    "rings": lambda: cases.ring_in_ring().problem,
    "dual rings": dual_rings,
    "disc on a block": cases.pressed_disc,
    "disc on a plane": cases.disc_on_rigid_plane,
    "graded": lambda: laws.graded(1e3).problem,
    "bent fibres": lambda: laws.bent_fibres(100.0, 0.3).problem,
}


def with_forces():
    """Rings under radial and axial forces that are no polynomials."""
    return Problem(
        geometry=axisymmetric_cases.cylinders(0.5),
        materials=cases.BLOCKS,
        displacement={"bottom": (0, 0), "top": (None, -1.0)},
        traction={"upper_side": (0, ng.sin(9 * ng.y))},
        force={"upper|lower": (ng.x * ng.y, ng.exp(ng.x * ng.y))},
        contact=[Contact("upper_contact", "lower_contact")],
        model="axisymmetric",
    )


def o_ring():
    """Curves that do not match."""
    return Problem(
        geometry=ring_in_groove(),
        materials={"ring": Elastic(1.0, 0.3), "housing|plate": Elastic(5.0, 0.3)},
        displacement={"housing_bottom": (0, 0), "plate_top": (0, -0.01)},
        contact=[
            Contact("ring_lower", "groove", direction=(0, -1)),
            Contact("ring_upper", "plate_face", direction=(0, 1)),
        ],
        model="axisymmetric",
    )


REVOLVED = {
    "cylinders": axisymmetric_cases.pressed_cylinders,
    "dual cylinders": lambda: axisymmetric_cases.pressed_cylinders(rows="dual"),
    "Huber": lambda: axisymmetric_cases.hertz_contact()[0],
    "shrink fit": lambda: axisymmetric_cases.fitted_rings()[0],
    "cone": lambda: axisymmetric_cases.indented_by_cone()[0],
    "forces": with_forces,
    "O-ring": o_ring,
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Arrays of a certificate that passes, and where they are."""
    path = tmp_path_factory.mktemp("certificate") / "certificate.npz"
    solution = solve(cases.hertz_contact(half_width=0.5).problem, maxh=0.25, order=2)
    solution.equilibrated.save(path)
    return path, passing(path), solution


def passing(path):
    """Arrays of a file in which every check holds."""
    assert check_certificate.check(path)
    with np.load(path) as file:
        return dict(file)


def cases_of(scenes, orders):
    return [
        pytest.param(scenes[name], order, id=f"{name}-{order}")
        for name in scenes
        for order in orders
    ]


@pytest.mark.study(
    witness=[
        "transition-1",
        "hertz-2",
        "dual rows-1",
        "dual rings-2",
        "cylinders-2",
        "shrink fit-2",
    ]
)
@pytest.mark.parametrize(
    ("scene", "order"),
    cases_of(SCENES, [1, 2, 3]) + cases_of(BENT, [2, 3]) + cases_of(REVOLVED, [1, 2]),
)
def test_certificates_pass(scene, order, tmp_path, capsys):
    solution = solve(scene(), maxh=0.5, order=order)
    path = solution.equilibrated.save(tmp_path / "certificate.npz")
    passed = check_certificate.check(path)
    said = capsys.readouterr().out
    assert passed, said
    assert f"|u - u_h| <= {solution.error_bound:.9g}" in said


def changed(array, factor=1 + 1e-6):
    """One entry, the largest, changed by a millionth."""
    array = array.astype(float)
    array.flat[np.abs(array).argmax()] *= factor
    return array


TAMPERED = {
    "a smaller bound": lambda a: {"bound": a["bound"] * (1 - 1e-6)},
    "a stress": lambda a: {"stress": changed(a["stress"])},
    "all stresses": lambda a: {"stress": a["stress"] * (1 + 1e-6)},
    "a discrete stress": lambda a: {"discrete_stress": changed(a["discrete_stress"], 1.01)},
    "a force": lambda a: {"force": a["force"] + np.abs(a["stress"]).max() * 1e-3},
    "a vertex": lambda a: {"vertices": changed(a["vertices"])},
    "an inverted triangle": lambda a: {"triangles": a["triangles"][:, ::-1]},
    "a missing triangle": lambda a: {
        name: a[name][:-1]
        for name in (
            *("triangles", "stress", "discrete_stress", "force"),
            *("law", "loads", "curves", "lifting"),
        )
    },
    "a law": lambda a: {"law": changed(a["law"], 1.01)},
    "an indefinite law": lambda a: {"law": -a["law"]},
    "a load on the zone": lambda a: {
        "strip_load": a["strip_load"] + np.abs(a["stress"]).max() * 1e-6
    },
    "supports that are none": lambda a: {"edge_constrained": np.ones_like(a["edge_constrained"])},
    "a missing edge": lambda a: {
        name: a[name][:-1]
        for name in (
            "edge_triangle",
            "edge_side",
            "edge_frame",
            "edge_constrained",
            "edge_traction",
        )
    },
    "a pulling pressure": lambda a: {"contact_pressure": -a["contact_pressure"]},
    "a pressure": lambda a: {"contact_pressure": changed(a["contact_pressure"])},
    "a turned direction": lambda a: {"strip_action": a["strip_action"][:, :, ::-1]},
    "a long direction": lambda a: {"strip_action": a["strip_action"] * (1 + 1e-6)},
    "an action without reaction": lambda a: {"strip_action": changed(a["strip_action"])},
    "an overlap": lambda a: {"gap_open": a["gap_open"] - a["gap_open"].max() * 1e-6},
    "a wider gap": lambda a: {"gap_open": a["gap_open"] + a["gap_open"].max() * 1e-3},
    "a smaller weight": lambda a: {"gap_weight": a["gap_weight"] * (1 - 1e-6)},
    "no lifting": lambda a: {"lifting": a["lifting"] * 0},
    "a negative norm": lambda a: {"lifting": -a["lifting"]},
    "not a number": lambda a: {"stress": changed(a["stress"], np.nan)},
}


@pytest.mark.parametrize("name", TAMPERED)
@pytest.mark.study(witness=["an inverted triangle", "a pressure", "not a number"])
def test_tampered_certificates_fail(name, saved, tmp_path, capsys):
    _, arrays, _ = saved
    np.savez(tmp_path / "tampered.npz", **(arrays | TAMPERED[name](arrays)))
    assert not check_certificate.check(tmp_path / "tampered.npz")
    assert "FAIL" in capsys.readouterr().out


TAMPERED_CURVES = {
    "a smaller bound": lambda a: {"bound": a["bound"] * (1 - 1e-6)},
    "a stress": lambda a: {"stress": changed(a["stress"])},
    "a discrete stress": lambda a: {"sampled_stress": changed(a["sampled_stress"], 1.01)},
    "a law": lambda a: {"sampled_law": changed(a["sampled_law"], 1.01)},
    "an indefinite law": lambda a: {"sampled_law": -a["sampled_law"]},
    "smaller weights": lambda a: {"sampled_weights": a["sampled_weights"] * (1 - 1e-6)},
    "a moved point": lambda a: {"sampled_points": changed(a["sampled_points"], 1 + 1e-4)},
    "a quadrature of lower order": lambda a: {"sampled_exact": a["sampled_exact"] - 10},
    "a map": lambda a: {"sampled_map": changed(a["sampled_map"])},
    "a missing map": lambda a: {
        name: a[name][1:]
        for name in ("sampled_triangle", "sampled_map", "sampled_stress", "sampled_law")
    },
    "maps of others": lambda a: {"sampled_map": a["sampled_map"][::-1]},
    "all constants": lambda a: {"curves": a["curves"] * (1 - 1e-6)},
    "no constants, a smaller bound": lambda a: {"curves": 0 * a["curves"], "bound": less(a)},
    "a missing strip": lambda a: {
        name: v[:-1] for name, v in a.items() if name.startswith("strip_")
    },
    "narrow strips": lambda a: {"strip_weight": a["strip_weight"] * (1 - 1e-4)},
    "a load": lambda a: {"strip_load": a["strip_load"] + np.abs(a["stress"]).max() * 1e-6},
    "free components": lambda a: {"strip_counts": ~a["strip_counts"], "bound": less(a)},
    "an action": lambda a: {"strip_action": changed(a["strip_action"])},
    "a pulling pressure": lambda a: {"contact_pressure": -a["contact_pressure"]},
    "other places of p*": lambda a: {"strip_s": 1 - a["strip_s"]},
}


def less(a):
    return a["bound"] * (1 - 1e-6)


@pytest.fixture(scope="module")
def curved(tmp_path_factory):
    """The same of curved triangles."""
    path = tmp_path_factory.mktemp("certificate") / "certificate.npz"
    return passing(solve(BENT["rings"](), maxh=0.5, order=2).equilibrated.save(path))


@pytest.mark.parametrize("name", TAMPERED_CURVES)
def test_tampered_curves_fail(name, curved, tmp_path, capsys):
    np.savez(tmp_path / "tampered.npz", **(curved | TAMPERED_CURVES[name](curved)))
    assert not check_certificate.check(tmp_path / "tampered.npz")
    assert "FAIL" in capsys.readouterr().out


def at_points(name, change):
    """Of all rules."""
    return lambda a: {k: change(v) for k, v in a.items() if k.endswith(name) and k[:4] == "rule"}


TAMPERED_REVOLVED = {
    "a smaller bound": lambda a: {"bound": less(a)},
    "a stress": lambda a: {"stress": changed(a["stress"])},
    "all stresses": lambda a: {"stress": a["stress"] * (1 + 1e-6)},
    "radial forces": at_points("_radial", lambda v: v + 1e-3),
    "hoop stresses": at_points("_stress", lambda v: v * [1, 1, 1 + 1e-4, 1]),
    "a law": at_points("_law", lambda v: changed(v, 1.01)),
    "smaller weights": at_points("_weights", lambda v: v * (1 - 1e-6)),
    "a missing triangle in a rule": lambda a: {
        k: v[1:]
        for k, v in a.items()
        if k in {f"rule0_{name}" for name in ("triangle", "stress", "law", "radial")}
    },
    "axial forces": lambda a: {"force": a["force"] + np.abs(a["stress"]).max() * 1e-3},
    "a moved axis": lambda a: {"vertices": a["vertices"] + [1e-3, 0]},
    "a body beyond the axis": lambda a: {"vertices": a["vertices"] - [1e-3, 0]},
    "a load on the zone": lambda a: {
        "strip_load": a["strip_load"] + np.abs(a["stress"]).max() * 1e-6
    },
    "a pulling pressure": lambda a: {"contact_pressure": -a["contact_pressure"]},
    "a pressure": lambda a: {"contact_pressure": changed(a["contact_pressure"])},
    "an action without circumference": lambda a: {"strip_action": changed(a["strip_action"])},
    "an overlap": lambda a: {"gap_open": a["gap_open"] - a["gap_open"].max() * 1e-6},
    "a wider gap": lambda a: {"gap_open": a["gap_open"] + a["gap_open"].max() * 1e-3},
    "a smaller weight": lambda a: {"gap_weight": a["gap_weight"] * (1 - 1e-6)},
    "no lifting": lambda a: {"lifting": a["lifting"] * 0},
}


@pytest.fixture(scope="module")
def revolved(tmp_path_factory):
    """The same about an axis that the body meets."""
    path = tmp_path_factory.mktemp("certificate") / "certificate.npz"
    problem, _ = axisymmetric_cases.hertz_contact(a=0.5)
    return passing(solve(problem, maxh=0.25, order=2).equilibrated.save(path))


@pytest.mark.parametrize("name", TAMPERED_REVOLVED)
def test_tampered_bodies_of_revolution_fail(name, revolved, tmp_path, capsys):
    np.savez(tmp_path / "tampered.npz", **(revolved | TAMPERED_REVOLVED[name](revolved)))
    assert not check_certificate.check(tmp_path / "tampered.npz")
    assert "FAIL" in capsys.readouterr().out


def negative_at_its_least(array, share):
    """The entry of least size replaced by a negative share of the largest."""
    array = array.copy()
    array.flat[np.abs(array).argmin()] = -share * np.abs(array).max()
    return array


def with_another_point(a, share):
    """One more point of the gap, of which the weight is a negative share of the largest."""
    more = {"gap_piece": 0, "gap_s": 0.5, "gap_open": 0.0}
    more["gap_weight"] = -share * a["gap_weight"].max()
    return {name: np.append(a[name], value) for name, value in more.items()}


SIGNED = {
    "gap_weight": with_another_point,
    "gap_open": lambda a, share: {"gap_open": negative_at_its_least(a["gap_open"], share)},
    "pressure": lambda a, share: {
        "contact_pressure": negative_at_its_least(a["contact_pressure"], share)
    },
    "lifting": lambda a, share: {"lifting": negative_at_its_least(a["lifting"], share)},
}


@pytest.mark.parametrize("name", SIGNED)
@pytest.mark.parametrize(("share", "passes"), [(5e-15, True), (1e-12, False)])
def test_zero_may_be_round_off_of_either_sign(name, share, passes, revolved, tmp_path, capsys):
    """A circumference on the axis is -1e-20 with some kernels of BLAS and NumPy."""
    np.savez(tmp_path / "other.npz", **(revolved | SIGNED[name](revolved, share)))
    assert check_certificate.check(tmp_path / "other.npz") == passes, capsys.readouterr().out


def test_round_off_of_weights_does_not_lower_the_bound(revolved, tmp_path, capsys):
    """A huge gap where a weight is round-off below 0 would, if that weight counted."""
    arrays = revolved
    weight, gap = arrays["gap_weight"].copy(), arrays["gap_open"].copy()
    p = arrays["contact_pressure"][arrays["gap_piece"]].min(axis=1)
    at = np.argmax(p)
    weight[at] = -1e-15 * weight.max()
    wanted = 0.1 * arrays["bound"] ** 2
    gap[at] = wanted / (2e-15 * weight.max() * p[at])
    lower = np.sqrt(arrays["bound"] ** 2 - wanted)
    changes = {"gap_weight": weight, "gap_open": gap, "bound": lower}
    np.savez(tmp_path / "other.npz", **(arrays | changes))
    assert not check_certificate.check(tmp_path / "other.npz")
    assert "FAIL  B follows" in capsys.readouterr().out


def test_the_driver_needs_nothing_but_numpy(saved):
    path, arrays, solution = saved
    tree = ast.parse(DRIVER.read_text())
    names = {a.name for x in ast.walk(tree) if isinstance(x, ast.Import) for a in x.names}
    names |= {x.module for x in ast.walk(tree) if isinstance(x, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} - set(sys.stdlib_module_names) == {"numpy"}
    done = subprocess.run([sys.executable, DRIVER, path], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert float(arrays["bound"]) == solution.error_bound


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_certificates_of_copies_pass(copied, tmp_path):
    solution = solve(BENT["graded"](), maxh=0.5, order=2)
    assert solution.error_bound > 0
    path = copied(solution).equilibrated.save(tmp_path / "certificate.npz")
    assert check_certificate.check(path)


def test_the_name_of_the_file(saved, tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.npz"):
        saved[2].equilibrated.save(tmp_path / "certificate.txt")
