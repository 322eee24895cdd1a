"""VTK's data objects: arrays in and out, outlines, extents, pieces, what is kept between runs."""
