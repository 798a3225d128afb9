"""Numerical kernels of the finite-element operators: arrays in, arrays out, no language inside."""
