"""Operators of lists: one module per kind of work."""
