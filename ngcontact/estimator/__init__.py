"""Error indicators of a solution."""
