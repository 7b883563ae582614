"""What a solution is asked for: values where one wants them, tables, files that outlive it."""

from .archive import read as read
from .location import Location as Location
from .location import locate as locate
from .members import Readable as Readable
from .progress import with_progress as with_progress
from .values import Values as Values
from .values import values_at as values_at
