"""Checks of solutions that share no code with the package.

`measures` reads a solution, `balance` and `reference` (with its `lines`) know what is right from
the scene's data alone, `variants` and `judging` compare, `report` tells.
"""
