"""The 3D view of the window, its tools and keys."""
