"""Read and write VTK data objects: arrays, outlines, bounds, pieces and cached geometry."""
