"""What may be wrong although the discrete problem is solved, and what to do about it."""

from .contact_pairs import doubts as doubts
from .corners import contradictions as contradictions
from .corners import warn_of_implausible as warn_of_implausible
from .estimates import EXACT as EXACT
from .estimates import at_round_off as at_round_off
from .estimates import doubt_of_refinement as doubt_of_refinement
from .estimates import estimates_rise as estimates_rise
