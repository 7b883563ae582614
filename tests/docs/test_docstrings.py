"""Every public docstring gives the shapes of arrays, and units of what the contract promises."""

import ast
import inspect
import re

import pytest

import ngcontact
import ngcontact.geometries as geometries
from ngcontact import Elastic, Hooke, Problem, Solution, solve_qp
from ngcontact.qp import Iterate
from tests.docs.docstrings import (
    SHAPE,
    Claim,
    array_types,
    arrays_in,
    claims,
    entries,
    entry,
    modules,
    sections,
    shapes_returned,
)
from tests.docs.names import resolved
from tests.docs.pages import DOCS

TREES = modules()
TYPES = array_types(TREES)


@pytest.mark.parametrize("module", TREES)
def test_arrays_have_shapes(module):
    missing = [str(claim) for claim in claims(module, TREES[module], TYPES) if not claim.holds()]
    assert not missing


def test_claims_are_found():
    """About the number of today: a reader that finds nothing would find no fault."""
    assert sum(1 for module in TREES for _ in claims(module, TREES[module], TYPES)) > 300
    assert {"Array", "Index", "Mask"} <= TYPES


# Units.

# What a docstring may call the unit of a quantity, by dimension. Units are any consistent set.
UNITS = {
    "length": r"(?:any consistent |in )?units? of length|\ba length\b",
    "stress": r"units? of stress",
    "force": r"(?:units? of )?force per (?:unit )?(?:thickness|length)",
    "energy": r"(?:units? of )?energy(?:,)? per (?:unit )?thickness|\bper unit thickness\b",
    "energy norm": r"root of (?:an )?energy(?: per (?:unit )?thickness)?",
    "none": r"\bdimensionless\b",
    "angle": r"\b(?:degrees|radians)\b",
    "any": r"any consistent units?",
}

# Every attribute and method of `Solution`, and the dimension of what it gives.
SOLUTION = {
    "displacement": "length",
    "stress": "stress",
    "out_of_plane_stress": "stress",
    "hoop_stress": "stress",
    "points": "length",
    "direction": "none",
    "gap": "length",
    "force": "force",
    "pressure": "stress",
    "contact_force": "force",
    "nodal_reaction": "force",
    "reactions": "force",
    "transitions": "length",
    "energy": "energy",
    "energy_norm": "energy norm",
    "indicators": "energy norm",
    "error_estimate": "energy norm",
    "estimate_parts": "energy",
    "relative_error_estimate": "none",
    "error_bound": "energy norm",
    "relative_error_bound": "none",
    "bound_parts": "energy",
    "energy_bounds": "energy",
    "quantities": "any",
    "contact_area": "any",
    "equilibrated": "stress",
    "residuals": "none",
    "at": "any",
    "along": "any",
    "record": "any",
}
# ... and those that are no quantities: objects, names, numbers of things, truth values, files.
PLAIN = {
    *("problem", "mesh", "order", "element", "discrete", "minimiser", "work", "coarse_levels"),
    "descent",
    *("adaptive", "pair", "active", "steps", "free_motions", "estimated", "bounded"),
    *("pairs", "write", "revolved", "plot", "draw", "save"),
}


def said_of(cls, name):
    """What the class or the attribute itself says of it."""
    member = inspect.getattr_static(cls, name, None)
    if name in getattr(cls, "__dataclass_fields__", {}):
        return entry(inspect.getdoc(cls), name)
    return inspect.getdoc(getattr(member, "func", member)) or ""


def unitless(text, dimension):
    """Whether a text gives no unit of that dimension; "any consistent units" serves for all."""
    return not any(re.search(UNITS[word], text) for word in (dimension, "any"))


def test_every_attribute_of_a_solution_is_listed():
    public = {name for name in dir(Solution) if not name.startswith("_")}
    public |= Solution.__dataclass_fields__.keys()
    assert public - SOLUTION.keys() - PLAIN == set()
    assert SOLUTION.keys() | PLAIN == public


@pytest.mark.parametrize(("name", "dimension"), SOLUTION.items())
def test_a_solution_says_its_units(name, dimension):
    assert not unitless(said_of(Solution, name), dimension)


def test_solve_qp_says_its_units():
    """Its numbers have the units of the caller's."""
    assert not unitless(inspect.getdoc(solve_qp), "any")
    assert not unitless(inspect.getdoc(Iterate), "any")


@pytest.mark.parametrize("law", [Elastic, Hooke])
def test_laws_say_their_units(law):
    for name in inspect.signature(law).parameters:
        assert not unitless(entry(inspect.getdoc(law), name), "none" if name == "nu" else "stress")


def test_a_problem_says_its_units():
    for name, dimension in {"displacement": "length", "traction": "stress", "force": "any"}.items():
        assert not unitless(entry(inspect.getdoc(Problem), name), dimension)


@pytest.mark.parametrize("name", geometries.__all__)
def test_geometries_say_their_units(name):
    """Each number in its entry, or "Lengths are in any consistent unit" in the text for all."""
    function = getattr(geometries, name)
    docstring = inspect.getdoc(function)
    parameters = inspect.signature(function).parameters.items()
    numbers = [parameter for parameter, kind in parameters if "float" in str(kind.annotation)]
    assert numbers
    if "Lengths are in any consistent unit" in sections(docstring)[""]:
        return
    kinds = ("length", "angle", "none")
    said = {number: entry(docstring, number) for number in numbers}
    assert not [n for n, text in said.items() if all(unitless(text, kind) for kind in kinds)]


def test_public_names_have_docstrings():
    assert all(inspect.getdoc(getattr(ngcontact, name)) for name in ngcontact.__all__)


# The reader itself.

EXAMPLE = """Mean of `values` (k, 2) and `others`, `more` (k,) at points, (2,) and (k,).

Parameters
----------
weight, share : ndarray (k,)
    Of each.
point : tuple
    Its place (x, y).
index : ndarray of int
    Which, (m, order + 1).

Returns
-------
first, second : ndarray (3 b, r)
int
"""


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("values", True),
        ("others", True),
        ("more", True),
        ("weight", True),
        ("share", True),
        ("index", True),
        ("point", False),
        ("first", False),
        ("absent", False),
    ],
)
def test_shapes_of_parameters(name, shape):
    assert Claim("f", name, 1, EXAMPLE).holds() == shape


def test_shapes_returned():
    assert shapes_returned(EXAMPLE) == 4
    assert shapes_returned("Of `values` (k, 2).") == 0
    assert shapes_returned("Points and weights, (k,) each.") == float("inf")
    assert Claim("f", "", 4, EXAMPLE).holds()
    assert not Claim("f", "", 5, EXAMPLE).holds()


def test_sections_and_entries():
    assert list(sections(EXAMPLE)) == ["", "Parameters", "Returns"]
    assert [names for names, _ in entries(sections(EXAMPLE)["Parameters"])] == [
        ["weight", "share"],
        ["point"],
        ["index"],
    ]


@pytest.mark.parametrize(
    "text", ["(m,)", "(m, 2)", "(3 b, r)", "(k, order + 1)", "(..., degree + 1)", "(2N, 2n)"]
)
def test_shapes(text):
    assert SHAPE.fullmatch(text)


@pytest.mark.parametrize(
    "text", ["(m)", "(x, y)", "(Judice, Pires 1994)", "(P_1h)", "(2.10)", "()"]
)
def test_no_shapes(text):
    assert not SHAPE.search(text)


@pytest.mark.parametrize(
    ("annotation", "count"),
    [
        ("Array", 1),
        ("Array | None", 1),
        ("NDArray[np.bool_]", 1),
        ("sp.csr_array", 1),
        ("'Array'", 1),
        ("tuple[Array, Index, int]", 2),
        ("dict[str, Array]", 1),
        ("list[Array] | tuple[Array, Array]", 2),
        ("Callable[[Array], Array]", 0),
        ("float | ng.CoefficientFunction", 0),
    ],
)
def test_arrays_in_annotations(annotation, count):
    assert arrays_in(ast.parse(annotation, mode="eval").body, TYPES) == count


def test_entries_of_the_reference_have_a_text_of_their_own():
    """`order, element : ...` becomes two entries of one text on the site."""
    pages = "".join(page.read_text() for page in (DOCS / "reference").glob("*.md"))
    names = re.findall(r"^\.\. auto\w+:: (?:ngcontact\.)?([\w.]+)$", pages, re.MULTILINE)
    assert len(names) > 20
    joint = re.compile(r"^ *(\w+(?:, \w+)+)(?: : .*)?\n +[A-Z0-9]", re.MULTILINE)
    found = []
    for name in names:
        top = resolved(name)
        members = set(dir(top)) - set(getattr(top, "__dataclass_fields__", ()))
        for thing in (top, *(getattr(top, member, None) for member in sorted(members))):
            text = re.split(r"\n *Raises\n", getattr(thing, "__doc__", None) or "")[0]
            found += [f"{name}: {entry}" for entry in joint.findall(text)]
    assert not found
