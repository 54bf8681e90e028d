"""What a job is and what can be done with one. Knows the standard library and the geometry."""
