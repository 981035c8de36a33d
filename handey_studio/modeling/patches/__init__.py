"""The planar faces that one scan shows, with their outlines."""
