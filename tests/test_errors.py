"""Warnings point at the caller's line."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from ngcontact import ContactWarning
from ngcontact.errors import warn


def test_a_warning_names_the_line_outside_of_the_package():
    with pytest.warns(ContactWarning, match="may be wrong") as caught:
        warn("this may be wrong")
    assert Path(caught[0].filename) == Path(__file__)


def test_a_warning_can_be_made_an_error():
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactWarning)
        with pytest.raises(ContactWarning):
            warn("this may be wrong")
