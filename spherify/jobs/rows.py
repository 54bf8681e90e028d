"""Rows of the time series as one array of records, for files.

Each row names an iteration and the figures of `spherify.geometry.metrics.Metrics`; whole numbers stay whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

ROWS: Final = "metrics"
"""Name, in a snapshot's file, of the rows up to it."""

BEST: Final = "best_metrics"
"""Name, in a snapshot's file, of the row of the best state so far, which may not be among the recorded ones."""

Row = dict[str, float | int]


def rows_to_array(rows: Sequence[Row]) -> NDArray[Any]:
    """Return one record a row; all rows must have the same names in the same order, and there must be one."""
    fields = [(name, np.int64 if isinstance(value, int) else np.float64) for name, value in rows[0].items()]
    return np.array([tuple(row.values()) for row in rows], dtype=fields)


def rows_to_list(array: NDArray[Any]) -> list[Row]:
    """Return what `rows_to_array` was given."""
    names = array.dtype.names or ()
    return [dict(zip(names, record, strict=True)) for record in array.tolist()]
