"""Work of the window: the pipeline in a thread, exports in processes."""
