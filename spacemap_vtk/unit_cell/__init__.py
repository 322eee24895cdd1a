"""Unit cells of composites: voxels of one repeat of a textile, and their effective constants."""
