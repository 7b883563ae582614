"""The rooms of ngcontact and what they import from each other, drawn from the imports themselves.

``python docs/developers/architecture.py`` writes the picture ``architecture.png`` and the table in
``architecture.md``. Floors are those of the import contract in ``pyproject.toml``; arrows are the
imports that grimp finds, type-only ones included. The picture carries them as text.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import grimp
from drawing import picture
from importlinter.api import read_configuration

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PICTURE, PAGE = HERE / "architecture.png", HERE / "architecture.md"
START, END = "<!-- rooms: from architecture.py -->\n\n", "\n\n<!-- end -->"
MESHES = ("ngsolve", "netgen", "pyngcore")

Imports = dict[str, set[str]]


def floors() -> list[list[str]]:
    """Rooms by floor, top down, as the import contract orders them."""
    contracts = read_configuration(str(ROOT / "pyproject.toml"))["contracts_options"]
    [layers] = [contract["layers"] for contract in contracts if contract["type"] == "layers"]
    return [re.split(r"\s*\|\s*", layer) for layer in layers]


def graph_of_rooms() -> grimp.ImportGraph:
    """Imports of the package with every room as one module, libraries outside included."""
    graph = grimp.build_graph("ngcontact", include_external_packages=True, cache_dir=None)
    for room in graph.find_children("ngcontact"):
        graph.squash_module(room)
    return graph


def imports() -> Imports:
    """Rooms that each room imports from."""
    graph = graph_of_rooms()
    rooms = [room for floor in floors() for room in floor]
    found = {room: graph.find_modules_directly_imported_by(f"ngcontact.{room}") for room in rooms}
    return {
        room: {name.split(".")[1] for name in names if name.startswith("ngcontact.")} - {room}
        for room, names in found.items()
    }


def knows_meshes() -> dict[str, bool]:
    """Whether each room loads NGSolve, itself or through others."""
    graph = graph_of_rooms()
    return {
        room: any(
            graph.chain_exists(importer=f"ngcontact.{room}", imported=library)
            for library in MESHES
            if library in graph.modules
        )
        for floor in floors()
        for room in floor
    }


def summary(room: str) -> str:
    """First line of the docstring of a room."""
    source = ROOT / "ngcontact" / room / "__init__.py"
    if not source.exists():
        source = source.parent.with_suffix(".py")
    docstring = ast.get_docstring(ast.parse(source.read_text())) or ""
    return docstring.split("\n")[0]


def ground(edges: Imports) -> set[str]:
    """Modules on the lowest floors that import nothing else: any room may use them."""
    found: set[str] = set()
    for floor in reversed(floors()):
        modules = {x for x in floor if (ROOT / "ngcontact" / x).with_suffix(".py").exists()}
        found |= {room for room in modules if edges[room] <= found}
    return found


def without_detours(edges: Imports) -> Imports:
    """The imports that do not follow from others: there is no longer way over other rooms."""
    below: Imports = {}

    def reached(room: str) -> set[str]:
        if room not in below:
            below[room] = edges[room].union(*map(reached, edges[room]))
        return below[room]

    return {room: to - set().union(*map(reached, to)) for room, to in edges.items()}


def as_text(edges: Imports) -> str:
    """One line a room, ``contact: arrays constraints fem``, and an empty line between floors."""
    lines = {room: f"{room}: {' '.join(sorted(to))}".rstrip() for room, to in edges.items()}
    return "\n\n".join("\n".join(lines[room] for room in floor) for floor in floors())


def table(edges: Imports) -> str:
    """The same with words: every room, what it holds, from where it imports."""
    rows = [
        f"| `{room}` | {summary(room)} | {', '.join(other for other in edges if other in to)} |"
        for room, to in edges.items()
    ]
    return "\n".join(["| room | what it holds | imports from |", "|---|---|---|", *rows])


def page(text: str, edges: Imports) -> str:
    """The page `text` with the table of today."""
    before, rest = text.split(START)
    _, after = rest.split(END)
    return before + START + table(edges) + END + after


def main() -> None:
    """Write picture and table."""
    edges = imports()
    PAGE.write_text(page(PAGE.read_text(), edges))
    base = ground(edges)
    figure = picture(
        [floor for floor in floors() if not base & set(floor)],
        without_detours({room: to - base for room, to in edges.items() if room not in base}),
        [room for room in edges if room in base],
        {room: summary(room).split(". ")[0].rstrip(".").replace("`", "") for room in edges},
        knows_meshes(),
    )
    figure.savefig(PICTURE, dpi=110, metadata={"Imports": as_text(edges)})


if __name__ == "__main__":
    main()
