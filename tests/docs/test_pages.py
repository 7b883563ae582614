"""What the pages name exists: modules and what they hold, files, drivers, links."""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from drivers.__main__ import drivers
from tests.docs.names import resolved

ROOT = Path(__file__).parents[2]
TEXTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text() for path in TEXTS}
CODE = re.compile(r"```.*?```|`([^`\n]+)`", re.DOTALL)
HISTORY = "CHANGELOG.md"  # names what was, too


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


@pytest.mark.parametrize("page", sorted(PAGES.keys() - {HISTORY}))
def test_names_of_the_package_exist(page):
    missing = [name for name in dotted(PAGES[page]) if not exists(name)]
    assert not missing


def test_names_are_found():
    assert dotted("`fem.space.Space`, `solution.plot(path)`, `x.y` and `os.path`: `qp`") == [
        "fem.space.Space",
        "solution.plot",
    ]
    assert exists("solution.points")
    assert exists("solution.Solution.work")
    assert not exists("solution.pints")
    assert not exists("fem.spice")


def test_modules_of_the_theory_exist():
    [table] = re.findall(
        r"^\| where \| contents \|\n(.*?)\n\n", PAGES["docs/theory.md"], re.M | re.S
    )
    cells = [row.split("|")[1] for row in table.splitlines()[1:]]
    modules = [name for cell in cells for name in re.findall(r"`([\w.]+)`", cell)]
    assert len(modules) > 30
    for module in modules:
        import_module(f"ngcontact.{module}")


def test_theory_speaks_of_every_room():
    rooms = {name.split(".")[0] for name in re.findall(r"`([\w.]+)`", PAGES["docs/theory.md"])}
    packages = {path.parent.name for path in (ROOT / "ngcontact").glob("*/__init__.py")}
    assert packages - {"geometries"} <= rooms


@pytest.mark.parametrize("page", sorted(PAGES.keys() - {HISTORY}))
def test_files_and_drivers_exist(page):
    text = PAGES[page]
    files = re.findall(
        r"(?<![\w/])(?:(?:ngcontact|docs|drivers|geometries|tests)/[\w/]+\.py)", text
    )
    assert not [file for file in files if not (ROOT / file).exists()]
    drivers = re.findall(r"python -m (drivers[\w.]*\w)", text)
    assert not [driver for driver in drivers if find_spec(driver) is None]


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", PAGES[page])
    missing = [link for link in links if not (ROOT / page).parent.joinpath(link).exists()]
    assert not missing


def test_the_page_of_drivers_has_all_of_them():
    page = PAGES["docs/gallery/drivers.md"]
    assert not [name for name in drivers() if f"`python -m drivers.{name}`" not in page]


@pytest.mark.parametrize("word", ["thermal", "bolt", "seal", "press fit", "bearing"])
def test_words_of_machine_design_lead_somewhere(word):
    """What a reader types into the search stands on a page, with a link or an answer beside it."""
    assert re.search(rf"\*\*{word}\*\*", PAGES["docs/topics/limits.md"])
