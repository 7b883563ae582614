"""Plausibility of data and results: warnings, with what to do about each."""

from .data import Contradiction as Contradiction
from .data import contradictions as contradictions
from .data import warn_of_implausible as warn_of_implausible
from .pairs import pair_warnings as pair_warnings
from .refinement import EXACT_ESTIMATE as EXACT_ESTIMATE
from .refinement import at_round_off as at_round_off
from .refinement import estimates_rise as estimates_rise
from .refinement import refinement_warning as refinement_warning
