"""Draw scale bars, axes, times and labels over a picture."""
