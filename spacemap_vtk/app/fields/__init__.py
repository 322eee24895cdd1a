"""Editors of parameters, one class for each kind; `row.make_editor` selects the class."""
