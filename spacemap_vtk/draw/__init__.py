"""One renderer for the window, pictures, films and figures."""
