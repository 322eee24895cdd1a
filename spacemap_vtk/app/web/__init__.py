"""The live pipeline in a browser: the server draws pictures and streams them."""
