"""Widgets for parameters, one class for each kind; `row.editor_of` chooses by the declaration."""
