"""Curves: EVOL, EXTR, IPOL, INTG, and the operators of lists on ordinates."""
