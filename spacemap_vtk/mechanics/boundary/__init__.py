"""Boundary conditions: places, supports, fittings and loads."""
