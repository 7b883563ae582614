"""Files and pictures of a solution."""
