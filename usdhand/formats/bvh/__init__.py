"""BVH, the text format of motion capture: read into clips, written from clips."""
