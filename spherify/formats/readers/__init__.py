"""One file a format: bytes to vertices and triangles. Run in the reading process only."""
