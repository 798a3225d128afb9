"""Points, lines, surfaces, volumes: making them, choosing parts of them, putting them together."""
