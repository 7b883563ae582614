from .exceptions import at_ends as at_ends
from .exceptions import settled as settled
from .marking import doerfler as doerfler
from .marking import together as together
from .refinement import refined as refined
