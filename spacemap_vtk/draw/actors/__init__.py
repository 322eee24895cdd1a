"""Actors for the parts of a scene: surfaces, sheets, glyphs, shading."""
