"""Checks of solutions that share no code with the package.

`measures` reads a solution, `balance` and `reference` know what is right from the scene's data
alone, `judging` compares.
"""
