"""Bars of contact forces that are proved, by dual problems."""

from .bar import force_bar as force_bar
from .dual import Tested as Tested
