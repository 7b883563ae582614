"""The discrete problems (P_1h), (P_2h) of HH81: assembled, in equilibrium, started, re-used."""
