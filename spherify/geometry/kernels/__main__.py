"""`python -m spherify.geometry.kernels`: make the machine code of the compiled engine now, and keep it."""

from __future__ import annotations

from spherify.geometry.kernels.compiled import CompiledEngine

CompiledEngine().warm()
