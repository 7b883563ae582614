"""Certificates of bounds are checked with NumPy alone; tampered ones fail."""

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
from ngcontact import Contact, solve
from tests.estimator.bound.test_energies import SCENES as BOUNDED
from tests.estimator.bound.test_equilibrium import opening

DRIVER = Path(check_certificate.__file__)


def on_obstacle():
    """No support but guides: a rigid plane holds the lower block."""
    contact = [*opening().contact, Contact("bottom", gap=0.0)]
    return opening(displacement={}, contact=contact, traction={"pressed|top": 1.0})


def with_forces():
    """Rings under radial and axial forces that are no polynomials."""
    return replace(
        axisymmetric_cases.pressed_cylinders(0.5),
        displacement={"bottom": (0, 0), "top": (None, -1.0)},
        traction={"upper_side": (0, ng.sin(9 * ng.y))},
        force={"upper|lower": (ng.x * ng.y, ng.exp(ng.x * ng.y))},
    )


SCENES = {
    "transition": (lambda: cases.one_transition().problem, [1, 2, 3, 4]),
    "hertz": (lambda: cases.hertz_contact().problem, [1, 2, 3, 4]),
    "body forces": (lambda: cases.clamped_transition().problem, [2, 3]),
    "guided": (lambda: cases.guided_transition().problem, [1, 2]),
    "corners": (lambda: cases.polygonal_patch().problem, [1, 3]),
    "lifting off": (opening, [1, 2, 3, 4]),
    "bilateral": (BOUNDED["bilateral"], [1, 2, 3]),
    "obstacle": (on_obstacle, [1, 2, 3]),
    "punch": (cases.flat_punch, [1, 2, 4]),
    "dual rows": (BOUNDED["dual rows"], [1, 2, 3]),
    "layers": (lambda: laws.stiff_and_soft(1e8).problem, [1, 2]),
    "graded": (lambda: laws.graded(1e3).problem, [2]),
    "bent fibres": (lambda: laws.bent_fibres(100.0, 0.3).problem, [2, 3]),
    "cylinders": (axisymmetric_cases.pressed_cylinders, [1, 2, 3]),
    "dual cylinders": (lambda: axisymmetric_cases.pressed_cylinders(rows="dual"), [2]),
    "Huber": (lambda: axisymmetric_cases.hertz_contact()[0], [1, 2]),
    "shrink fit": (lambda: axisymmetric_cases.fitted_rings()[0], [1, 2]),
    "cone": (lambda: axisymmetric_cases.indented_by_cone()[0], [2]),
    "forces": (with_forces, [1, 2]),
}


@pytest.mark.parametrize(
    ("name", "order"), [(name, order) for name, (_, orders) in SCENES.items() for order in orders]
)
def test_certificates_pass(name, order, tmp_path, capsys):
    solution = solve(SCENES[name][0](), maxh=0.5, order=order)
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


def without_last(a, *beginnings):
    """Arrays with one entry less."""
    return {name: v[:-1] for name, v in a.items() if name.startswith(beginnings)}


def size(a):
    return np.abs(a["stress"]).max()


def alike(name, change):
    """A change of one array."""
    return lambda a: {name: change(a[name])}


TAMPERED = {
    "a smaller bound": alike("bound", lambda v: v * (1 - 1e-6)),
    "a stress": alike("stress", changed),
    "another degree": alike("degree", lambda v: v - 1),
    "a place of the lattice": alike("lattice", changed),
    "a strain": alike("rule0_strain", lambda v: changed(v, 1.01)),
    "a force": lambda a: {"force": a["force"] + 1e-6 * size(a)},
    "a vertex": alike("vertices", changed),
    "an inverted triangle": alike("triangles", lambda v: v[:, ::-1]),
    "a flat triangle": alike("triangles", lambda v: v[:, [0, 1, 1]]),
    "a missing triangle": lambda a: without_last(a, "triangles", "stress", "force", "rule0"),
    "a triangle in no quadrature": lambda a: without_last(a, "rule0_triangle", "rule0_strain"),
    "a law": alike("rule0_compliance", lambda v: changed(v, 1.01)),
    "an indefinite law": alike("rule0_compliance", lambda v: -v),
    "weights": alike("rule0_weights", lambda v: v * (1 - 1e-6)),
    "a place of a quadrature": alike("rule0_points", lambda v: changed(v, 1 + 1e-4)),
    "a missing side": lambda a: without_last(a, "side"),
    "supports that are none": alike("side_held", np.zeros_like),
    "a load": lambda a: {"side_traction": a["side_traction"] + 1e-6 * size(a)},
    "a pulling pressure": alike("contact_pressure", lambda v: -v),
    "a pressure": alike("contact_pressure", changed),
    "pressures at other ends": alike("contact_pressure", lambda v: v[:, ::-1]),
    "wider sides": alike("contact_weight", lambda v: v * (1 + 1e-6)),
    "another side in contact": alike("contact_side", lambda v: np.roll(v, 1)),
    "an action without reaction": alike("contact_other", lambda v: v * 0 - 1),
    "a reaction elsewhere": alike("contact_other", lambda v: np.roll(v, 1)),
    "a reaction the other way round": alike("contact_turned", np.logical_not),
    "contact that may pull": alike("contact_equality", np.ones_like),
    "an overlap": alike("contact_gap", lambda v: v - 1e-6 * v.max()),
    "a wider gap": alike("contact_gap", lambda v: v + 1e-3 * v.max()),
    "no gap": alike("contact_gap", np.zeros_like),
    "no lifting": alike("lifting", np.zeros_like),
    "a negative norm": alike("lifting", np.negative),
    "loads that take off": alike("loads", lambda v: v - 1.0),
    "not a number": alike("stress", lambda v: changed(v, np.nan)),
    "no strains": lambda a: {"rule0_strain": None},
}

TAMPERED_LOADS = {
    "smaller norms": alike("loads", lambda v: v * (1 - 1e-6)),
    "negative norms": alike("loads", np.negative),
    "a force": alike("force", changed),
    "a load": alike("side_traction", changed),
    "loads at other ends": alike("side_traction", lambda v: v * (-1.0) ** np.arange(v.shape[2])),
}

TAMPERED_GUIDES = {
    "a guide's force": alike("contact_pressure", lambda v: changed(v, 1 + 1e-6)),
    "open gaps": alike("contact_gap", lambda v: v + 1.0),
    "contact that does not pull": alike("contact_equality", np.zeros_like),
}

TAMPERED_REVOLVED = {
    "a stress": alike("stress", changed),
    "a plane body": alike("axisymmetric", np.logical_not),
    "radial forces": lambda a: {"rule0_radial": a["rule0_radial"] + size(a)},
    "hoop strains": alike("rule0_strain", lambda v: v * np.array([1, 1, 1 + 1e-4, 1])),
    "axial forces": lambda a: {"force": a["force"] + 1e-6 * size(a)},
    "a moved axis": alike("vertices", lambda v: v + np.array([1e-3, 0])),
    "a body beyond the axis": alike("vertices", lambda v: v - np.array([1e-3, 0])),
    "a side without circumference": alike("contact_weight", lambda v: v * 0 + v.mean()),
}

KINDS = {"hertz": TAMPERED, "body forces": TAMPERED_LOADS}
KINDS |= {"bilateral": TAMPERED_GUIDES, "Huber": TAMPERED_REVOLVED}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Paths, arrays and solutions of one certificate of each kind."""
    found = {}
    for name in KINDS:
        solution = solve(SCENES[name][0](), maxh=0.5, order=2)
        path = tmp_path_factory.mktemp("certificate") / "certificate.npz"
        solution.equilibrated.save(path)
        assert check_certificate.check(path)
        with np.load(path) as file:
            found[name] = path, dict(file), solution
    return found


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind, changes in KINDS.items() for name in changes]
)
def test_tampered_certificates_fail(kind, name, saved, tmp_path, capsys):
    _, arrays, _ = saved[kind]
    changes = arrays | KINDS[kind][name](arrays)
    rest = {name: array for name, array in changes.items() if array is not None}
    np.savez(tmp_path / "tampered.npz", **rest)
    assert not check_certificate.check(tmp_path / "tampered.npz")
    assert "FAIL" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["contact_weight", "contact_gap", "contact_pressure"])
@pytest.mark.parametrize(("share", "passes"), [(5e-15, True), (1e-12, False)])
def test_zero_may_be_round_off_of_either_sign(name, share, passes, saved, tmp_path, capsys):
    """A circumference on the axis is -1e-20 with some kernels of BLAS and NumPy."""
    _, arrays, _ = saved["Huber"]
    array = arrays[name].copy()
    assert np.abs(array).min() <= 1e-15 * np.abs(array).max()
    array.flat[np.abs(array).argmin()] = -share * np.abs(array).max()
    np.savez(tmp_path / "other.npz", **(arrays | {name: array}))
    assert check_certificate.check(tmp_path / "other.npz") == passes, capsys.readouterr().out


def test_round_off_of_weights_does_not_lower_the_bound(saved, tmp_path, capsys):
    """A huge gap where a weight is round-off below 0 would, if that weight counted."""
    _, arrays, _ = saved["hertz"]
    weight, gap = arrays["contact_weight"].copy(), arrays["contact_gap"].copy()
    p = arrays["contact_pressure"].max(axis=1)
    at = np.argmin(np.where(p > 0, p, np.inf))
    weight[at] = -1e-15 * weight.max()
    wanted = 0.1 * arrays["bound"] ** 2
    gap[at] = wanted / (-2 * weight[at, 0] * arrays["contact_pressure"][at].mean())
    lower = np.sqrt(arrays["bound"] ** 2 - wanted)
    changes = {"contact_weight": weight, "contact_gap": gap, "bound": lower}
    np.savez(tmp_path / "other.npz", **(arrays | changes))
    assert not check_certificate.check(tmp_path / "other.npz")
    assert "FAIL  B follows" in capsys.readouterr().out


def test_the_driver_needs_nothing_but_numpy(saved):
    path, arrays, solution = saved["hertz"]
    tree = ast.parse(DRIVER.read_text())
    names = {a.name for x in ast.walk(tree) if isinstance(x, ast.Import) for a in x.names}
    names |= {x.module for x in ast.walk(tree) if isinstance(x, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} - set(sys.stdlib_module_names) == {"numpy"}
    done = subprocess.run([sys.executable, DRIVER, path], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert float(arrays["bound"]) == solution.error_bound


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_certificates_of_copies_pass(copied, tmp_path):
    solution = solve(SCENES["bent fibres"][0](), maxh=0.5, order=2)
    assert solution.error_bound > 0
    path = copied(solution).equilibrated.save(tmp_path / "certificate.npz")
    assert check_certificate.check(path)


@pytest.mark.parametrize(("order", "reason"), [(1, "turns along"), (2, "a curved side")])
def test_curves_have_no_certificate(order, reason, tmp_path):
    """Normals are those of the drawing, at order 1 too."""
    solution = solve(cases.ring_in_bearing().problem, maxh=0.5, order=order)
    with pytest.raises(ValueError, match=reason):
        solution.equilibrated.save(tmp_path / "certificate.npz")


def test_the_name_of_the_file(saved, tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.npz"):
        saved["hertz"][2].equilibrated.save(tmp_path / "certificate.txt")
