"""Vibration modes of a cage, their damping, and residual vectors."""
