"""Bézier patches: bases, tessellation and normals."""
