"""Each thing stands in one place of the package, and chains of imports are short."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]

FILES = [*(ROOT / "ngcontact").rglob("*.py"), *(ROOT / "geometries").glob("*.py")]
SOURCES = {path.resolve().relative_to(ROOT).as_posix(): path.read_text() for path in FILES}


def with_lines(pattern: str) -> set[str]:
    """Modules with a line that has the pattern."""
    return {path for path, source in SOURCES.items() if re.search(pattern, source)}


def test_types_of_arrays_stand_in_one_module():
    assert with_lines(r"(?m)^\w+(: TypeAlias)? = (np\.ndarray|NDArray)\b") == {
        "ngcontact/arrays.py"
    }


def test_meshes_are_read_as_arrays_in_one_module():
    assert with_lines(r"\b(Elements[123]D|Coordinates)\(") == {"ngcontact/problem/mesh_arrays.py"}


def test_boundaries_are_selected_by_name_in_one_module():
    """Where a problem is checked, reactions are named, and a boundary selects its segments."""
    outside = {path for path in with_lines(r"boundary_mask\(") if "/problem/" not in path}
    assert outside == {"ngcontact/fem/boundary.py", "ngcontact/discrete/admissible_set.py"}


def test_arrays_are_cut_into_pairs_in_one_module():
    """Rooms that know of no pairs split other things; the dual program splits by its lines."""
    without_pairs = ("ngcontact/qp/", "ngcontact/linalg/", "ngcontact/constraints/")
    without_pairs += ("ngcontact/estimator/bound/program.py",)
    cut = with_lines(r"np\.split\(|(cumsum|accumulate)\(\(?\[?(0, \*\()?len")
    assert {path for path in cut if not path.startswith(without_pairs)} == {
        "ngcontact/contact/line.py"
    }


def test_fields_are_named_not_reflected():
    assert with_lines("__annotations__") == set()


def exported(face: Path) -> set[str]:
    """Names that a face makes public."""
    imports = [n for n in ast.walk(ast.parse(face.read_text())) if isinstance(n, ast.ImportFrom)]
    return {name.asname or name.name for node in imports for name in node.names}


def test_no_module_bears_the_name_of_what_its_package_exports():
    faces = list((ROOT / "ngcontact").rglob("__init__.py*"))
    modules = {face: {path.stem for path in face.parent.glob("*.py")} for face in faces}
    assert {face: exported(face) & names for face, names in modules.items()} == {
        face: set() for face in faces
    }


def package_imports() -> dict[str, set[str]]:
    """Modules that each module of the package imports; names of faces stand for their modules."""
    arrows: dict[str, dict[str, str]] = {}  # by module, the full name of each name imported
    for path in (ROOT / "ngcontact").rglob("*.py"):
        stub = path.with_suffix(".pyi")  # of a face that is read lazily
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        package = module.rpartition(".")[0]
        found = arrows.setdefault(module.removesuffix(".__init__"), {})
        for node in ast.walk(ast.parse((stub if stub.exists() else path).read_text())):
            if isinstance(node, ast.ImportFrom) and node.level:
                base = package.split(".")[: package.count(".") + 2 - node.level]
                base += [node.module] if node.module else []
                for name in node.names:
                    found[f"{name.asname or name.name}"] = ".".join([*base, name.name])

    def defined(name: str) -> str:
        """The module in which an imported name is defined."""
        if name in arrows:
            return name
        module, _, name = name.rpartition(".")
        return defined(arrows[module][name]) if name in arrows.get(module, ()) else module

    faces = {name.rpartition(".")[0] for name in arrows}
    return {
        module: {defined(name) for name in names.values()} - faces - {module}
        for module, names in arrows.items()
        if module not in faces
    }


def test_chains_of_imports_are_short():
    """A reader has at most so many modules between what is asked and the arrays it is made of."""
    imports, longest = package_imports(), dict[str, int]()

    def chain(module: str) -> int:
        if module not in longest:
            longest[module] = 1 + max((chain(name) for name in imports[module]), default=0)
        return longest[module]

    assert imports["ngcontact.linalg.multigrid"] >= {
        "ngcontact.arrays",
        "ngcontact.linalg.sparse",
        "ngcontact.qp.schur_complement",  # by the face of its room
    }
    assert max(chain(module) for module in imports) <= 15
