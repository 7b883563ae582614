"""Links of the pages to lines of the source lead to the listings that viewcode makes, or nowhere.

On a checkout `../../ngcontact/fem/space.py` is a link that works. The site has a listing of a
module only if the reference documents something in it; the text of other links stands as code.
"""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class SourceLines(SphinxTransform):
    """Replace links to files of the source by their text, set as code."""

    default_priority = 5  # before MyST resolves them

    def apply(self, **kwargs: object) -> None:
        """Visit all links of a page that lead to files below the root but outside of docs."""
        folder = Path(self.env.doc2path(self.env.docname)).parent
        for node in list(self.document.findall(nodes.Element)):
            target = node.get("reftarget") or node.get("refuri") or ""
            path = target.partition("#")[0]
            if path.endswith(".py") and "://" not in path and (folder / path).is_file():
                node.replace_self(nodes.literal(text=node.astext()))


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the transform."""
    app.add_transform(SourceLines)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
