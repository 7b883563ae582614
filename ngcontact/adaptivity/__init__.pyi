from .exceptions import at_ends as at_ends
from .exceptions import at_limit as at_limit
from .exceptions import settled as settled
from .exceptions import warn_of_limit as warn_of_limit
from .marking import doerfler as doerfler
from .marking import together as together
from .refinement import refined as refined
