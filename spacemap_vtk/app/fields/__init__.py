"""Editors of parameters, one class for each kind; `row.editor_of` selects the class."""
