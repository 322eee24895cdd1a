"""Draw on the processor, without OpenGL."""
