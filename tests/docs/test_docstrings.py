"""Every public docstring gives the shapes of arrays, and units of what the contract promises."""

import inspect
import re

import pytest

import ngcontact.geometries as geometries
from ngcontact import Elastic, Hooke, Problem, Solution
from tests.docs.docstrings import (
    SHAPE,
    array_types,
    claims,
    entry,
    modules,
    sections,
)

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


# The reader itself.


@pytest.mark.parametrize(
    "text", ["(m,)", "(m, 2)", "(3 b, r)", "(k, order + 1)", "(..., degree + 1)", "(2N, 2n)"]
)
def test_shapes(text):
    assert SHAPE.fullmatch(text)
