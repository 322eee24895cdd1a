"""Read and write files of drafts: WIF, .dtx and .wpo, rows of text, and pictures."""
