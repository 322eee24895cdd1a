"""Render scenes with one renderer for the window, pictures, films and figures."""
