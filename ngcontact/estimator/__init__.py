"""Error indicators of a solution."""

from .residual import Estimate as Estimate
from .residual import estimate as estimate
