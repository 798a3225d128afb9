"""Mesh adaptation: from an error map to the sizes of a new mesh."""
