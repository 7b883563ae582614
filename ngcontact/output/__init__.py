"""Files and pictures of a solution."""

from .files import check_path as check_path
from .files import replacing as replacing
from .nodes import COMPONENTS as COMPONENTS
from .nodes import principal_stresses as principal_stresses
from .nodes import stress_tensors as stress_tensors
from .pictures import plot_convergence as plot_convergence
from .pictures import plot_solution as plot_solution
from .pictures import slope_triangle as slope_triangle
from .pictures import write_film as write_film
from .scene import Profile as Profile
from .scene import Unit as Unit
from .solids import plot_solids as plot_solids
from .vtk import write_revolved as write_revolved
from .vtk import write_series as write_series
from .vtk import write_solution as write_solution
