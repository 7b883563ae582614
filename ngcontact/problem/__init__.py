"""The continuous contact problem of HH81 section 3: laws, pairs, supports, loads, checks."""
