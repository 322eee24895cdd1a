"""Relaxed yarns of any textile: elastic rods in contact in a periodic cell."""
