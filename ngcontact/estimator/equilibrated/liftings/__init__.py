"""Liftings w of what the discrete displacement misses on Gamma_u and Gamma_K."""

from .edges import EdgeField as EdgeField
from .edges import at_points as at_points
from .edges import norms as norms
from .edges import panels as panels
from .misses import Gap as Gap
from .misses import gap_of as gap_of
from .misses import lifted as lifted
from .misses import on_contact as on_contact
from .misses import on_supports as on_supports
