"""Help: the manual, guided walks, keys, and the command palette."""
