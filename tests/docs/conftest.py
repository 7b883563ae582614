"""The scripts that make pages, as modules."""

from importlib import import_module
from pathlib import Path

import pytest

DEVELOPERS = Path(__file__).parents[2] / "docs" / "developers"


@pytest.fixture
def script(monkeypatch):
    """A script of docs/developers by its name."""
    monkeypatch.syspath_prepend(DEVELOPERS)
    return import_module
