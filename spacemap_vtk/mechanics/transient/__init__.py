"""Implicit steps of the nonlinear equations of motion."""
