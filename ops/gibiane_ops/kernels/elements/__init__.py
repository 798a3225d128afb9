"""Reference shapes: nodes, shape functions, faces and quadrature, one file per family of shapes."""
