"""Uniform against adaptive refinement: `runs` of both, tables and pictures of them."""
