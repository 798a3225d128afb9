"""Operators that make pictures and files: DEFORME, VECTEUR, TRACER, DESSINER, SORTIR 'VTK'."""
