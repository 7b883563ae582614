from .marking import doerfler as doerfler
from .refinement import refined as refined
