"""Kinds of stress, one a module.

Each module has a function ``outcomes()`` that yields one `Outcome` per line of the table; where
numbers are drawn it takes a ``seed``.
"""
