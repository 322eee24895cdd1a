"""Vibration modes of a cage, and what a few of them leave out."""
