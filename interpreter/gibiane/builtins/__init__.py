"""Operators of the language itself, declared like any other."""

from gibiane.builtins import arithmetic, clock, control, errors, external, logic, objects, options, tables, text

__all__ = ["arithmetic", "clock", "control", "errors", "external", "logic", "objects", "options", "tables", "text"]
