"""One file a format: bytes to vertices and triangles. Run in the reading process only.

Ours rather than trimesh's: its parsers name no line, hold no count against the size of the file and cannot read some
valid files (blank lines and comments in PLY, STL without its last line), so the walk over the file that tells would
stay ours anyway; and importing it takes as long as all else that is done with a small file.
"""
