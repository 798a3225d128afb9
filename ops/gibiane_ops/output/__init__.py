"""Operators that make pictures and files: DEFORME, VECTEUR, TRACER, DESSIN, SORTIR 'VTK'."""
