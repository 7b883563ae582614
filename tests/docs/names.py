"""Names in the pages, as objects of the package."""

from importlib import import_module
from importlib.util import find_spec
from typing import get_type_hints


def resolved(name: str) -> object:
    """Module, function, class or attribute of `ngcontact` by its dotted name below it."""
    found: object = import_module("ngcontact")
    for part in name.split("."):
        if isinstance(found, property):
            found = get_type_hints(found.fget)["return"]
        module = f"{getattr(found, '__name__', '')}.{part}"
        if hasattr(found, "__path__") and find_spec(module):
            found = import_module(module)
        else:
            fields = getattr(found, "__dataclass_fields__", {})
            found = fields[part] if part in fields else getattr(found, part)
    return found
