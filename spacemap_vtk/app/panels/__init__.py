"""The tabs and lists around the view."""
