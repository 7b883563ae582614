"""Results of a solution: values at points, tables, files."""

from .archive import read as read
from .archive import restored as restored
from .archive import save as save
from .archive import state_of as state_of
from .record import Number as Number
from .record import line_of as line_of
from .record import record_of as record_of
from .record import with_progress as with_progress
from .values import Values as Values
from .values import values_at as values_at
