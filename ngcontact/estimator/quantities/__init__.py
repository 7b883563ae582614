"""What users read of a contact, each with a bar of its error."""

from .quantities import Quantities as Quantities
from .quantities import Quantity as Quantity
from .quantities import quantities_of as quantities_of
from .readings import Measured as Measured
