"""Pictures of solutions."""

from .picture import plot_solution as plot_solution
