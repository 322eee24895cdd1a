"""Scenes: read, check, build the pipeline, draw and write results."""
