"""Files, in and out: a module for each format, found by its ending."""
