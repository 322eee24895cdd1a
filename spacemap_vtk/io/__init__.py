"""Read and write files: each format is one module, and a file's ending chooses it."""
