"""Data that are made of numbers alone."""

from __future__ import annotations

import re
from weakref import WeakKeyDictionary

import ngsolve as ng

LONG = 4000  # of what is printed; numbers are short
KNOWN: WeakKeyDictionary[ng.CoefficientFunction, bool] = WeakKeyDictionary()  # numbers or not
# What NGSolve prints of numbers, also times others and times the normal.
NUMBER = r"[-+.\de]+"
NUMBERS = re.compile(
    rf"ZeroCoefficientFunction|\s*({NUMBER}\*\()?"
    rf"(coef (unary operation ' '|VectorialCoefficientFunction|ZeroCF|{NUMBER}|"
    rf"scale {NUMBER}|scalar-vector multiply|normal vector), real(, dim=\d+)?)?\s*\)?\s*"
)


def numbers(data: ng.CoefficientFunction) -> bool:
    """Whether data are made of numbers alone: these are nowhere rough. Looked at once."""
    if data not in KNOWN:  # printing a long expression costs as much as evaluating it
        text = str(data)
        lines = text.splitlines() if len(text) < LONG else [text]
        KNOWN[data] = len(text) < LONG and all(map(NUMBERS.fullmatch, lines))
    return KNOWN[data]
