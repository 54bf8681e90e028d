"""The passes of the compiled engine, one file each, and what joins them.

An elementary step runs through the mesh in passes: faces (normals, areas, altitudes), edges (the curvature's edge
values), vertices (the sums of both), then, once the extremes or percentiles of K are known, movement and relaxation.
All are written for one thing: that LLVM turns their inner loops into vector code.

- Coordinates lie in arrays of their own (x, y, z), so that a vector register holds one coordinate of several items.
- Indices are **unsigned** 32-bit: signed ones make numba emit a wrap-around test an access, which stops vectorising.
- Divisions follow numpy's rules (``error_model="numpy"``), for Python's raise, which is a branch.
- Arguments never overlap, and LLVM is told so (`jit.inner`); else no gather may be moved across a store.
- A pass works in blocks that fit the cache, through scratch arrays of one block, where gathering and calculating
  are two loops: either vectorises better alone.
- No sum is reordered by the compiler (no fastmath): the same bits on every machine with IEEE arithmetic.
"""
