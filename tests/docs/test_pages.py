"""What the pages name exists: modules and what they hold, files, drivers, links."""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from drivers.__main__ import drivers
from tests.docs.names import resolved

ROOT = Path(__file__).parents[2]
TEXTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text() for path in TEXTS}
CODE = re.compile(r"```.*?```|`([^`\n]+)`", re.DOTALL)
CURRENT = sorted(PAGES.keys() - {"CHANGELOG.md"})  # which names what was, too


def exists(name):
    """Whether a dotted name leads to something of ngcontact; `solution.x` may be a Solution's."""
    try:
        resolved(name)
    except AttributeError:
        return name.startswith("solution.") and exists(name.replace("solution", "Solution", 1))
    return True


def dotted(text):
    """Names below a room or a class at the top: `fem.space.Space`, `Solution.points`."""
    words = [match.group(1) or "" for match in CODE.finditer(text)]
    found = [re.match(r"(?:ngcontact\.)?(\w+)((?:\.\w+)+)(?=[\[(]|$)", word) for word in words]
    names = [(match.group(1), match.group(1) + match.group(2)) for match in found if match]
    return [name for first, name in names if find_spec(f"ngcontact.{first}") or first == "Solution"]


def test_names_of_the_package_exist():
    assert dotted("`fem.space.Space`, `x.y` and `os.path`: `qp`") == ["fem.space.Space"]
    assert not exists("solution.pints")
    names = {name for page in CURRENT for name in dotted(PAGES[page])}
    assert not [name for name in names if not exists(name)]


def test_modules_of_the_theory_exist_and_every_room_is_there():
    theory = PAGES["docs/theory.md"]
    [table] = re.findall(r"^\| where \| contents \|\n(.*?)\n\n", theory, re.M | re.S)
    cells = [row.split("|")[1] for row in table.splitlines()[1:]]
    modules = [name for cell in cells for name in re.findall(r"`([\w.]+)`", cell)]
    assert len(modules) > 30
    for module in modules:
        import_module(f"ngcontact.{module}")
    rooms = {name.split(".")[0] for name in re.findall(r"`([\w.]+)`", theory)}
    packages = {path.parent.name for path in (ROOT / "ngcontact").glob("*/__init__.py")}
    assert packages - {"geometries"} <= rooms


def test_files_drivers_and_links_exist():
    for page in CURRENT:
        files = re.findall(
            r"(?<![\w/])(?:(?:ngcontact|docs|drivers|geometries|tests)/[\w/]+\.py)", PAGES[page]
        )
        assert not [file for file in files if not (ROOT / file).exists()], page
        modules = re.findall(r"python -m (drivers[\w.]*\w)", PAGES[page])
        assert not [module for module in modules if find_spec(module) is None], page
    for page, text in PAGES.items():
        links = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text)
        assert not [x for x in links if not (ROOT / page).parent.joinpath(x).exists()], page


def test_pages_have_all_drivers_and_words_of_machine_design():
    """What a reader types into the search stands on a page, with a link or an answer beside it."""
    page, limits = PAGES["docs/gallery/drivers.md"], PAGES["docs/topics/limits.md"]
    assert not [name for name in drivers() if f"`python -m drivers.{name}`" not in page]
    words = ("thermal", "bolt", "seal", "press fit", "bearing")
    assert not [word for word in words if f"**{word}**" not in limits]
