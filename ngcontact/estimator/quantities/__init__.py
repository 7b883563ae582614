"""What users read of a contact, each with a bar of its error."""

from .readings import Measured as Measured
from .surfaces import told_before as told_before
from .table import Quantities as Quantities
from .table import Quantity as Quantity
