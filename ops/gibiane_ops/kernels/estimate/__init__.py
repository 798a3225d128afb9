"""A posteriori error: solid part, contact part, and their combination."""
