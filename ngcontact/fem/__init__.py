"""The finite element spaces V_h: elements, boundary nodes, forms, energies."""

from .bodies import Bodies as Bodies
from .bodies import body_of_unknown as body_of_unknown
from .bodies import connected_bodies as connected_bodies
from .boundary import BoundaryTrace as BoundaryTrace
from .boundary import boundary_trace as boundary_trace
from .element import check_element as check_element
from .element import node_basis as node_basis
from .element import unknowns as unknowns
from .element import unknowns_of as unknowns_of
from .energy import energy_norm as energy_norm
from .energy import potential_energy as potential_energy
from .model import MODELS as MODELS
from .model import Model as Model
from .model import model_of as model_of
from .model import stress_of as stress_of
from .moduli import NEARLY_INCOMPRESSIBLE as NEARLY_INCOMPRESSIBLE
from .moduli import bulk_moduli as bulk_moduli
from .moduli import nearly_incompressible as nearly_incompressible
from .moduli import shear_moduli as shear_moduli
from .moduli import warn_of_locking as warn_of_locking
from .space import LOAD_BONUS as LOAD_BONUS
from .space import Space as Space
from .space import assemble as assemble
from .space import load_vector as load_vector
