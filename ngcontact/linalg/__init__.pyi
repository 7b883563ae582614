from .coarse_spaces import coarsenings as coarsenings
from .coarse_spaces import refined_share as refined_share
from .iterative import IterativeSystems as IterativeSystems
from .multigrid import Multigrid as Multigrid
from .sparse import cholesky as cholesky
from .sparse import congruent as congruent
from .sparse import lower_half as lower_half
from .sparse import shared as shared
