"""Plausibility of data and results: warnings, with what to do about each."""

from .pairs import pair_warnings as pair_warnings
from .runs import EXACT_ESTIMATE as EXACT_ESTIMATE
from .runs import Contradiction as Contradiction
from .runs import at_round_off as at_round_off
from .runs import contradictions as contradictions
from .runs import estimates_rise as estimates_rise
from .runs import refinement_warning as refinement_warning
from .runs import warn_of_implausible as warn_of_implausible
