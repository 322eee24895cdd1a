"""Print a draft for the loom, on as many pages as are needed for legible cells."""
