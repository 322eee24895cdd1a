"""The weaver's plan of a project: ends, picks, reed, lengths and masses of yarn, loom."""
