"""The passes of the compiled engine, one file each, and what joins them.

An elementary step runs through the vertices (curvature, normals, areas, altitudes, all from the ring of neighbours),
then, once the extremes or percentiles of K are known, through movement and relaxation, which on large meshes goes along
with the vertices of the next step (`sweep`). These are written for groups of eight vertices in vector registers
(`tracing`, `wide`), the others as loops that LLVM turns into vector code:

- Coordinates lie in arrays of their own (x, y, z), so that a vector register holds one coordinate of several items;
  for whoever wants all three of a vertex from anywhere, also side by side (`types.Buffers.rows`).
- Indices are **unsigned** 32-bit: signed ones make numba emit a wrap-around test an access, which stops vectorising.
- Divisions follow numpy's rules (``error_model="numpy"``), for Python's raise, which is a branch.
- Arguments never overlap, and LLVM is told so (`jit.inner`); else no gather may be moved across a store.
- Loops go over vertices that have as many neighbours each, in blocks that fit the cache.
- No sum is reordered and no product fused by the compiler (no fastmath); what is fused says so (`arithmetic.fma`).
  So the bits are the same on every machine with IEEE arithmetic, whatever its vectors and the number of threads;
  but for the C library's powers (`relaxation`), logarithms and exponentials (`unfolding`) and arctangents (`corners`).
"""
