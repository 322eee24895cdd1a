"""Scale bars, axes, times and labels over a picture."""
