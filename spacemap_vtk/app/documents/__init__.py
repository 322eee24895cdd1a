"""The document that the window edits: text, files, undo."""
