"""Parts of large cloths, drawn as the level of detail asks."""
