"""Operators on fields: arithmetic, components, extreme values, sums, supports."""
