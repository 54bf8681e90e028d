"""One file a format: a mesh to bytes."""
