"""Stresses in equilibrium, vertex patch by vertex patch."""

from .bubbles import beside as beside
from .bubbles import bubble_norms as bubble_norms
from .bubbles import inside as inside
from .bubbles import on_parts as on_parts
from .closing import closed as closed
from .elements import raw_operators as raw_operators
from .equilibration import Equilibrated as Equilibrated
from .equilibration import equilibrated as equilibrated
from .equilibration import into_raw as into_raw
from .field import stress_field as stress_field
from .sweeps import improved as improved
