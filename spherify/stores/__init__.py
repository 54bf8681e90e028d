"""Adapters: where jobs, meshes, files and messages are kept. `open_stores` builds them from the settings."""
