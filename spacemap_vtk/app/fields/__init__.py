"""Widgets for parameters, one class for each kind; `make` chooses by the declaration."""
