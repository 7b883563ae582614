"""Below every executed page its notebook, to be downloaded."""

from __future__ import annotations

from pathlib import PurePosixPath

from sphinx.application import Sphinx


def _offered(app: Sphinx, docname: str, source: list[str]) -> None:
    """Add the link to the text of a page before it is read."""
    if source[0].startswith("---\nfile_format: mystnb\n"):
        name = PurePosixPath(docname).name
        source[0] += f"\n\n---\n\nThis page as a notebook: {{nb-download}}`{name}.ipynb`\n"


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen."""
    app.connect("source-read", _offered)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
