"""Closed-form response of modes to loads, at any time."""
