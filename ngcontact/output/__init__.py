"""Files and pictures of a solution."""

from .picture import plot_solution as plot_solution
from .solution_data import SolutionData as SolutionData
from .vtk import write_series as write_series
from .vtk import write_solution as write_solution
