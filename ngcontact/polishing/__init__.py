"""More digits for a solution whose contact ends somewhere: a mesh that follows, high orders."""

from .polishing import polish as polish
