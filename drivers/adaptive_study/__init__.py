"""Uniform against adaptive refinement: `studies`, their `runs` and `pictures` of both."""
