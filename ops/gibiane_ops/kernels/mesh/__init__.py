"""Making meshes without a mesher: subdivision, transfinite patches, sweeps, transformations, conversions, searches."""
