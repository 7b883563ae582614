"""Public names that take or return arrays, and what their docstrings say of them; read, not run."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[2]
FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef

# Types of arrays; aliases of them in the package's own modules are found.
ARRAYS = {"NDArray", "ndarray", "ArrayLike", "sparray", "spmatrix", "csr_array", "csc_array"}

# "(m, 2)", "(n,)", "(3 b, r)", "(k, order + 1)", but not "(x, y)" nor "(Judice, Pires 1994)".
_TERM = r"(?:\d+|\d*\s?(?:[a-wA-Z]|ne|nv|dim|(?:geometry_)?order|degree)(?!\w))"
_DIMENSION = rf"(?:\.\.\.|{_TERM}(?:\s?[-+*]\s?{_TERM})*)"
SHAPE = re.compile(rf"\({_DIMENSION},(?:\s{_DIMENSION},)*(?:\s{_DIMENSION})?\)")
_SECTION = re.compile(r"^(\w[\w ]*)\n-+$", re.MULTILINE)


def modules() -> dict[str, ast.Module]:
    """Sources of the package and its geometries, by path below the repository."""
    files = [*(ROOT / "ngcontact").rglob("*.py"), *(ROOT / "geometries").glob("*.py")]
    paths = {path.resolve().relative_to(ROOT).as_posix(): path for path in files}
    return {name: ast.parse(path.read_text()) for name, path in sorted(paths.items())}


def array_types(trees: dict[str, ast.Module]) -> set[str]:
    """`ARRAYS` and the aliases of them that modules define: ``Array``, ``Index``, ``Mask``, ..."""
    found, before = set(ARRAYS), set[str]()
    while found != before:
        before = set(found)
        for tree in trees.values():
            for node in tree.body:
                if isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation) == "TypeAlias":
                    if arrays_in(node.value, before):
                        found.add(ast.unparse(node.target))
    return found


def arrays_in(annotation: ast.expr | None, types: set[str]) -> int:
    """Number of arrays in an annotation; what functions in it take or return does not count."""
    match annotation:
        case None:
            return 0
        case ast.Constant(value=str(text)):
            return arrays_in(ast.parse(text, mode="eval").body, types)
        case ast.Subscript(value=ast.Name(id="Callable")):
            return 0
        case ast.Subscript(value=value) if arrays_in(value, types):
            return 1
        case ast.BinOp(left=left, right=right):  # alternatives
            return max(arrays_in(left, types), arrays_in(right, types))
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return int(name in types)
        case _:
            return sum(arrays_in(child, types) for child in ast.iter_child_nodes(annotation))


@dataclass(frozen=True)
class Claim:
    """Something that a docstring has to say: shapes of `wanted` arrays."""

    owner: str
    name: str
    wanted: int
    docstring: str

    def __str__(self) -> str:
        """As a reader would look for it."""
        return f"{self.owner}({self.name})" if self.name else f"{self.owner} -> shape"

    def holds(self) -> bool:
        """Whether the docstring gives the shapes."""
        if self.name:
            return bool(SHAPE.search(entry(self.docstring, self.name)))
        return shapes_returned(self.docstring) >= self.wanted


def sections(docstring: str) -> dict[str, str]:
    """Text by the numpydoc sections of a docstring; "" is what stands before them."""
    parts = _SECTION.split(docstring)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(section: str) -> list[tuple[list[str], str]]:
    """Names and text of each entry of a section: ``segment, s : ndarray (k,)`` and below."""
    heads = list(re.finditer(r"^(\S[^:\n]*?)(?: : .*)?$", section, re.MULTILINE))
    bounds = [*(head.start() for head in heads), len(section)]
    names = (re.split(r",\s*", head.group(1)) for head in heads)
    return [(these, section[slice(*at)]) for these, at in zip(names, pairwise(bounds), strict=True)]


def _in_words(name: str) -> re.Pattern[str]:
    """A name in backticks and its shape; several names may share one: "`a`, `b` and `c` (m, 2)"."""
    others = r"(?:(?:,| and|, and)\s`+\w+`+)*"
    return re.compile(rf"`{name}`+{others}\s{SHAPE.pattern}")


def entry(docstring: str, name: str) -> str:
    """What a docstring says of a parameter or an attribute; "" if nothing."""
    parts = sections(docstring)
    for title in ("Parameters", "Attributes"):
        for names, text in entries(parts.get(title, "")):
            if name in names:
                return text
    found = _in_words(name).search(parts[""])
    return found.group() if found else ""


def shapes_returned(docstring: str) -> float:
    """Number of arrays that a docstring gives shapes of, those of parameters aside."""
    parts = sections(docstring)
    told = 0
    for title in ("Returns", "Yields"):
        for names, text in entries(parts.get(title, "")):
            told += len(names) * bool(SHAPE.search(text))
    words = _in_words(r"\w+").sub("", parts[""])
    shapes = len(SHAPE.findall(words))
    return float("inf") if shapes and re.search(r"\beach\b", words) else told + shapes


def _parameters(node: FUNCTION) -> list[ast.arg]:
    """Parameters of a function."""
    return [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]


def _of_function(owner: str, node: FUNCTION, docstring: str, types: set[str]) -> Iterator[Claim]:
    for parameter in _parameters(node):
        if count := arrays_in(parameter.annotation, types):
            yield Claim(owner, parameter.arg, count, docstring)
    if count := arrays_in(node.returns, types):
        yield Claim(owner, "", count, docstring)


def _of_class(path: str, node: ast.ClassDef, types: set[str]) -> Iterator[Claim]:
    docstring = ast.get_docstring(node) or ""
    for part in node.body:
        match part:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=annotation):
                count = arrays_in(annotation, types)
                if count and not name.startswith("_"):
                    yield Claim(f"{path}:{node.name}", name, count, docstring)
            case ast.FunctionDef(name="__init__"):
                yield from _of_function(f"{path}:{node.name}", part, docstring, types)
            case ast.FunctionDef(name=name) if not name.startswith("_") or name == "__call__":
                text = ast.get_docstring(part) or ""
                yield from _of_function(f"{path}:{node.name}.{name}", part, text, types)


def claims(path: str, tree: ast.Module, types: set[str]) -> Iterator[Claim]:
    """What the docstrings of a module's public functions and classes have to say."""
    for node in tree.body:
        if getattr(node, "name", "_").startswith("_"):
            continue
        if isinstance(node, FUNCTION):
            docstring = ast.get_docstring(node) or ""
            yield from _of_function(f"{path}:{node.name}", node, docstring, types)
        elif isinstance(node, ast.ClassDef):
            yield from _of_class(path, node, types)
