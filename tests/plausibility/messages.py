"""What the package warns of during a call."""

import warnings

from ngcontact import ContactWarning


def told(call) -> list[str]:
    """Messages of the package's warnings during a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    assert {warning.category for warning in caught} <= {ContactWarning}
    return [str(warning.message) for warning in caught]


def quiet(call) -> bool:
    return told(call) == []


def only(call, *parts: str) -> bool:
    """Whether there is one warning, with all these parts."""
    [message] = told(call)
    return all(part in message for part in parts)
