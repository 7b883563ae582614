"""Exact solutions, and the contact problems whose solutions they are.

`westergaard` holds the fields of half-planes, `straight` and `curved` the solutions of two bodies
that meet on straight and on curved lines, `manufactured` those on a polygon and a circle and those
outside of H^2; `overkill` measures in H^1, and against a finer solution where none is known.
`cases` are the problems, ready to solve, `paper` those that stand for one theorem or remark each.
"""
