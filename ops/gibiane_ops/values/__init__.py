"""The finite-element objects of the language: meshes, fields, models, matrices."""
