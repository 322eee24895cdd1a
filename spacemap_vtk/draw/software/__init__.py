"""Drawing without OpenGL, on the processor."""
