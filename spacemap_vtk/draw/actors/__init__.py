"""What is drawn of a scene: surfaces, sheets, glyphs, shading."""
