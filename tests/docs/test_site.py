"""Every page of docs is in the tree of the site, and all Python in the pages runs."""

import gc
import re
import warnings
from collections.abc import Callable

import matplotlib.pyplot as plt
import pytest

import ngcontact
from ngcontact import ContactWarning
from tests.docs.pages import DOCS, ROOT, Block, blocks

TEXTS = sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md")])
BLOCKS = [
    block for path in TEXTS for block in blocks(path.relative_to(ROOT).as_posix(), path.read_text())
]
BY_THE_SITE = ("docs/howto/pandas.md",)  # needs pandas
BY_OTHER_TESTS = ("README.md",)  # with its figures
SLOW = ("docs/tutorials/own_geometry.md", "docs/howto/two_round_bodies.md")  # by `make studies`

# What a page that is no program of its own takes for granted.
PRESS = """
from drivers.reference.cases import pressure_patch
from ngcontact import adapt

problem = pressure_patch().problem
"""
GIVEN = {"docs/bounds.md": PRESS}


def test_reference_has_every_public_name():
    pages = "".join(path.read_text() for path in (DOCS / "reference").glob("*.md"))
    documented = set(re.findall(r"^\.\. auto\w+:: (?:ngcontact\.)?(\w+)$", pages, re.MULTILINE))
    assert set(ngcontact.__all__) <= documented


def test_all_blocks_are_read():
    texts = [path.read_text() for path in TEXTS]
    assert len(BLOCKS) == sum(x.count("```python") + x.count("{code-cell}") for x in texts)


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.page.startswith(BY_THE_SITE)], ids=str)
def test_the_site_executes(block):
    compile(block.code, str(block), "exec")
    assert block.cell, "only cells are executed: write {code-cell}"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Callable[[Block], None]:
    """Execute a block after those before it in its page, each once, in a folder of the page."""
    spaces: dict[str, dict[str, object]] = {}
    done: set[Block] = set()

    def upto(block: Block) -> None:
        if block.page not in spaces:
            spaces.clear()
            done.clear()
            gc.collect()  # few objects of much memory lie in circles: Python would wait
            spaces[block.page] = {"__name__": "__main__"}
            exec(GIVEN.get(block.page, ""), spaces[block.page])
        for other in BLOCKS:
            if other.page == block.page and other.line <= block.line and other not in done:
                code = "\n" * (other.line - 1) + other.code
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore" if other.quiet else "error", ContactWarning)
                    exec(compile(code, other.page, "exec"), spaces[block.page])
                done.add(other)

    folders = {block.page: tmp_path_factory.mktemp("page") for block in BLOCKS}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plt, "show", plt.close)

        def there(block: Block) -> None:
            patch.chdir(folders[block.page])
            upto(block)

        yield there


@pytest.mark.parametrize(
    "block",
    [
        pytest.param(b, id=str(b), marks=[pytest.mark.study] if b.page in SLOW else [])
        for b in BLOCKS
        if not b.page.startswith((*BY_THE_SITE, *BY_OTHER_TESTS))
    ],
)
def test_block_runs(block, run):
    run(block)
