"""Quadrature that follows the data: where functions are rough, and rules that resolve them."""

from .cells import SampledElements as SampledElements
from .cells import composite as composite
from .cells import evaluations as evaluations
from .cells import lattice as lattice
from .cells import local_functions as local_functions
from .features import features_of as features_of
from .features import unresolved as unresolved
from .features import where_features_are as where_features_are
from .loads import Load as Load
from .loads import loads_of as loads_of
from .loads import pieces as pieces
from .loads import rough_load as rough_load
from .loads import rough_segments as rough_segments
from .loads import sample_data as sample_data
from .loads import warn_of_data as warn_of_data
