"""Exact solutions, and the contact problems whose solutions they are.

`westergaard` holds the fields of half-planes, `straight` and `curved` the solutions of two bodies
that meet on straight and on curved lines, `cases` the problems, ready to solve.
"""
