"""What proves a bound, and the arrays from which that can be checked."""

from .certificate import certificate_arrays as certificate_arrays
from .record import Norms as Norms
from .record import Proof as Proof
from .sampled import sampled_stress as sampled_stress
