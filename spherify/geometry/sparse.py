"""Symmetric positive definite systems on the edges of a mesh, solved directly: one pattern, many values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import spilu, splu

from spherify.geometry.mesh import Floats, Ints

SOLVER: Final = "superlu"
_SYMMETRIC: Final = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}


class SymmetricSolver:
    """Solves A X = B for matrices A whose entries off the diagonal lie on the edges of a graph.

    The unknowns are put in an order of minimum degree once, by the pattern alone; every factorisation uses it.
    Pivots stay on the diagonal, as they may where A is positive definite. Same input, same bits.
    """

    def __init__(self, n: int, edges: Ints) -> None:
        """Find the order for n unknowns and ``edges`` (e, 2), each pair once."""
        degrees = np.bincount(edges.reshape(-1), minlength=n).astype(np.float64)
        self._n = n
        self._place = np.arange(n)  # of each unknown in the order
        self._arrange(edges)
        # Only the order is asked for: incomplete factors, of which next to nothing is kept, take a tenth of the time.
        self._place = spilu(
            self._matrix(degrees + 1, -np.ones(len(edges))), permc_spec="MMD_AT_PLUS_A",
            drop_tol=np.finfo(np.float64).max, fill_factor=1, **_SYMMETRIC,
        ).perm_c.astype(np.int64)  # fmt: skip
        self._order = np.argsort(self._place)
        self._arrange(edges)

    def solve(self, diagonal: Floats, off_diagonal: Floats, B: Floats) -> Floats | None:
        """Return X (n, k) of A X = B, with the right sides B (n, k); otherwise as `factorised`."""
        factors = self.factorised(diagonal, off_diagonal)
        return None if factors is None else factors(B)

    def factorised(self, diagonal: Floats, off_diagonal: Floats) -> Callable[[Floats], Floats] | None:
        """Return what solves A X = B for X (n, k) by B (n, k).

        Args:
            diagonal: (n,) A_ii.
            off_diagonal: (e,) A_ij = A_ji of each edge.

        Returns:
            the solver; None if A is singular, has an entry that is not finite, or takes more memory than there is.

        """
        if not (np.isfinite(diagonal).all() and np.isfinite(off_diagonal).all()):
            return None
        try:
            factors = splu(self._matrix(diagonal, off_diagonal), permc_spec="NATURAL", **_SYMMETRIC)
        except (RuntimeError, MemoryError):  # what SuperLU says of a singular matrix, and of too large a one
            return None

        def solve(B: Floats) -> Floats:
            X: Floats = factors.solve(np.asfortranarray(B[self._order]))[self._place]
            return X

        return solve

    def _arrange(self, edges: Ints) -> None:
        """Lay out the columns of the matrix in the present order, and note where each entry goes."""
        a, b = self._place[edges[:, 0]], self._place[edges[:, 1]]
        rows = np.concatenate([self._place, a, b])
        columns = np.concatenate([self._place, b, a])
        sorted_entries = np.lexsort((rows, columns))
        self._rows = rows[sorted_entries].astype(np.intc)
        self._starts = np.searchsorted(columns[sorted_entries], np.arange(self._n + 1)).astype(np.intc)
        self._entries = sorted_entries

    def _matrix(self, diagonal: Floats, off_diagonal: Floats) -> csc_array:
        values = np.concatenate([diagonal, off_diagonal, off_diagonal])[self._entries]
        return csc_array((values, self._rows, self._starts), shape=(self._n, self._n))
