"""The live pipeline in a browser: pictures are drawn here, and streamed."""
