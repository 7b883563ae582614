"""In the gallery's table every scene with the first picture that its notebook made."""

from __future__ import annotations

from itertools import islice
from pathlib import PurePosixPath

from docutils import nodes
from sphinx.application import Sphinx

INDEX = "gallery/index"


def _show(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    if docname != INDEX or app.builder.name != "html":
        return
    for row in doctree.findall(nodes.row):
        for link in list(row.findall(nodes.reference)):
            page = PurePosixPath(INDEX).with_name(PurePosixPath(link["refuri"]).stem)
            for picture in islice(app.env.get_doctree(str(page)).findall(nodes.image), 1):
                copy = picture.deepcopy()
                copy["alt"] = link.astext()
                shown = nodes.reference("", "", copy, internal=True, refuri=link["refuri"])
                row[-1] += nodes.paragraph("", "", shown)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register what follows the notebooks' execution."""
    app.connect("doctree-resolved", _show)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
