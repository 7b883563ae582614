"""Random scenes that are tried, `data` and `scenes`; problems of tests, `algebra` and `held`.

A trial has functions ``outcomes(seed, count)``, which yields one `Outcome` per line of the table,
and ``summary``.
"""
