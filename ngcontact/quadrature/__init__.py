"""Quadrature that follows the data: where functions are rough, and rules that resolve them."""

from .lattice import composite as composite
from .lattice import extent as extent
from .lattice import on_lattice as on_lattice
