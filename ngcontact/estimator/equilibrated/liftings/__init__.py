"""Liftings w of what the discrete displacement misses on Gamma_u and Gamma_K."""

from .edges import EdgeField as EdgeField
from .edges import at_points as at_points
from .edges import coefficients as coefficients
from .edges import derivative as derivative
from .edges import panels as panels
from .edges import samples as samples
from .gaps import Gap as Gap
from .gaps import Opened as Opened
from .gaps import gap_of as gap_of
from .gaps import on_contact as on_contact
from .gaps import without_idle as without_idle
from .misses import least_lifting as least_lifting
from .misses import lifted as lifted
from .misses import on_guides as on_guides
from .misses import on_supports as on_supports
