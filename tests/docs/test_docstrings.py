"""Docstrings give shapes of arrays, and units of what the contract promises.

A public function, class or attribute whose annotation has an array says for each array parameter
or attribute its name with a shape, in an entry ``name : ndarray (m, 2)`` or as "`name` (m, 2)" in
the text, fields also in a comment at their line or above it; and a shape of what it returns.
"""

import ast
import inspect
import re

from ngcontact import Solution
from tests.docs.pages import ROOT

_ARRAYS = "Array|Index|Mask|NDArray|ndarray|ArrayLike|sparray|spmatrix|csr_array|csc_array"
ARRAY = re.compile(rf"\b({_ARRAYS})\b")
# "(m, 2)", "(n,)", "(3 b, r)", "(k, order + 1)", but not "(x, y)" nor "(Judice, Pires 1994)".
_TERM = r"(?:\d+|\d*\s?(?:[a-wA-Z]|ne|nv|dim|(?:geometry_)?order|degree)(?!\w))"
_DIMENSION = rf"(?:\.\.\.|{_TERM}(?:\s?[-+*]\s?{_TERM})*)"
SHAPE = re.compile(rf"\({_DIMENSION},(?:\s{_DIMENSION},)*(?:\s{_DIMENSION})?\)")


def has_arrays(annotation):
    """Whether an annotation has an array; what functions in it take or return does not count."""
    text = ast.unparse(annotation).strip("'") if annotation else ""
    return bool(ARRAY.search(re.sub(r"Callable\[.*\]", "", text)))


def in_words(name):
    """A name in backticks and its shape; several names may share one: "`a`, `b` and `c` (m, 2)"."""
    return rf"`{name}`+(?:(?:,| and|, and)\s`+\w+`+)*\s{SHAPE.pattern}"


def entry(docstring, name):
    """What a docstring says of a name, in an entry of a section or in words; "" if nothing."""
    head = rf"^(?:\w+, )*{name}(?:, \w+)*(?: : .*)?(?:\n(?:    .*)?)*"
    found = re.finditer(rf"{head}|{in_words(name)}", docstring, re.MULTILINE)
    return " ".join(match.group() for match in found)


def comment(lines, field):
    """What a comment says of a field: at its line, or above it and its neighbours."""
    at = field.lineno - 1
    if "#" in lines[at]:
        return lines[at].partition("#")[2]
    while re.match(r"    \w+: [^#]*$", lines[at]):
        at -= 1
    stop = at
    while lines[at].startswith("    #"):
        at -= 1
    return " ".join(lines[at + 1 : stop + 1])


def of_function(owner, node, docstring):
    """Claims (what, whether the docstring holds it) of parameters and of what is returned."""
    for parameter in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]:
        if has_arrays(parameter.annotation):
            said = entry(docstring, parameter.arg)
            yield f"{owner}({parameter.arg})", bool(SHAPE.search(said))
    if has_arrays(node.returns):
        words, _, parts = docstring.partition("Parameters\n------")
        rest = re.sub(in_words(r"\w+"), "", words) + parts.partition("Returns\n------")[2]
        yield f"{owner} -> shape", bool(SHAPE.search(rest))


def claims(path):
    """What the docstrings of a module's public functions and classes have to say."""
    source = path.read_text()
    for node in ast.parse(source).body:
        if getattr(node, "name", "_").startswith("_"):
            continue
        docstring, owner = ast.get_docstring(node) or "", f"{path}:{node.name}"
        if isinstance(node, ast.FunctionDef):
            yield from of_function(owner, node, docstring)
            continue
        for part in node.body:
            match part:
                case ast.AnnAssign(target=ast.Name(id=name), annotation=annotation):
                    if has_arrays(annotation) and not name.startswith("_"):
                        said = entry(docstring, name) + comment(source.splitlines(), part)
                        yield f"{owner}.{name}", bool(SHAPE.search(said))
                case ast.FunctionDef(name="__init__"):
                    yield from of_function(owner, part, docstring)
                case ast.FunctionDef(name=name) if not name.startswith("_") or name == "__call__":
                    text = ast.get_docstring(part) or ""
                    yield from of_function(f"{owner}.{name}", part, text)


def test_arrays_have_shapes():
    files = [*(ROOT / "ngcontact").rglob("*.py"), *(ROOT / "geometries").glob("*.py")]
    found = [claim for path in files for claim in claims(path)]
    assert len(found) > 300  # about the number of today: who finds nothing finds no fault
    assert not [what for what, holds in found if not holds]


# What a docstring may call the unit of a quantity.
UNIT = re.compile(
    r"units? of (length|stress|energy)|\ba length\b|\b(degrees|radians)\b|\bdimensionless\b"
    r"|per (unit )?(thickness|length)|root of (an )?energy|any consistent unit"
)


def members():
    """Names and docstrings of what a `Solution` has that are numbers, arrays or fields."""
    for name in (name for name in dir(Solution) if not name.startswith("_")):
        member = inspect.getattr_static(Solution, name)
        given = getattr(
            getattr(member, "func", getattr(member, "fget", member)), "__annotations__", {}
        )
        if re.search("float|Array|Coefficient|GridFunction", str(given.get("return"))):
            yield name, inspect.getdoc(member)


def test_a_solution_says_its_units():
    said = dict(members()) | {"displacement": entry(inspect.getdoc(Solution), "displacement")}
    assert len(said) > 20
    assert not [name for name, text in said.items() if not UNIT.search(text)]
