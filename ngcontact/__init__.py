"""Contact of elastic bodies: Haslinger and Hlavacek (1981) for NGSolve.

Each public name (``__init__.pyi`` lists them) is imported when it is first asked for: rooms of
arrays only serve without NGSolve, and files and pictures cost nothing until they are made.
"""

import lazy_loader as _lazy

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
