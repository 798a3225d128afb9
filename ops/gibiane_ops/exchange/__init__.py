"""Files that other programs read and write, and archives of a session."""
