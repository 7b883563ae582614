"""What may be wrong although the discrete problem is solved, and what to do about it."""

from .contact_pairs import doubts as doubts
from .estimates import doubt_of_refinement as doubt_of_refinement
from .estimates import estimates_rise as estimates_rise
