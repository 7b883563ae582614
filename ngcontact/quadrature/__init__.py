"""Quadrature that follows the data: where functions are rough, and rules that resolve them."""

from .cells import composite as composite
from .cells import extent as extent
from .cells import mesh_points as mesh_points
from .cells import on_lattice as on_lattice
from .doubts import Unresolved as Unresolved
from .doubts import unresolved as unresolved
from .doubts import warn_of_data as warn_of_data
from .doubts import warn_of_unresolved as warn_of_unresolved
from .features import Features as Features
from .features import features_of as features_of
from .features import look as look
from .features import touched as touched
from .integrals import integral_over as integral_over
from .integrals import pieces as pieces
from .integrals import rough_segments as rough_segments
from .jumps import jumping_moduli as jumping_moduli
from .jumps import warn_of_jumps as warn_of_jumps
from .loads import RoughLoad as RoughLoad
from .loads import keep_rough_load as keep_rough_load
from .loads import known_rough_load as known_rough_load
from .loads import moment_degree as moment_degree
from .loads import rough_load as rough_load
from .view import View as View
from .view import evaluations as evaluations
from .view import looked as looked
from .view import numbers as numbers
