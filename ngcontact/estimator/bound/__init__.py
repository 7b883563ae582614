"""A bound of the error that is proved, by one dual contact problem."""
