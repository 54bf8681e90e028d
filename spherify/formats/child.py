"""The process that reads a stranger's file: it limits itself, reads, and leaves plain arrays and JSON behind.

Started by `spherify.formats.reading` as ``python -m spherify.formats.child`` with a JSON request on its input. What it
writes into the folder of the request: ``answer.json``, and if the mesh was accepted ``vertices.npy`` and ``faces.npy``.
"""

from __future__ import annotations

import gc
import json
import math
import resource
import signal
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from spherify.formats.acceptance import accept
from spherify.formats.errors import MeshRefusedError, UnreadableError
from spherify.formats.limits import MIB, ReadLimits

_FLOAT_BYTES = 8


def confine(memory: int, seconds: float, file_bytes: int) -> None:
    """Limit this process for good, so that it ends even if its parent does not see to it."""
    for kind, most in (
        (resource.RLIMIT_AS, memory),  # macOS takes this one and does not enforce it
        (resource.RLIMIT_CPU, math.ceil(seconds) + 1),
        (resource.RLIMIT_FSIZE, file_bytes),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
        try:
            resource.setrlimit(kind, (soft, soft))
        except (ValueError, OSError):
            if sys.platform != "darwin":  # some releases refuse to lower RLIMIT_AS; clock and caps remain
                raise
    signal.setitimer(signal.ITIMER_REAL, seconds + 1)


def volunteer_for_lack_of_memory() -> None:
    """Have the kernel end this process, not the one that asked for it, when the machine runs out of memory."""
    if sys.platform.startswith("linux"):
        with suppress(OSError):  # a sandbox may have it read-only, and files can be read all the same
            Path("/proc/self/oom_score_adj").write_text("1000", "ascii")


def answer(request: dict[str, Any], limits: ReadLimits) -> dict[str, Any]:
    """Read the file of the request and return the JSON form of what is to be said about it."""
    folder = Path(request["folder"])
    try:
        result = accept(Path(request["path"]).read_bytes(), request["name"], request["allow"], limits)
    except UnreadableError as error:
        return {"code": error.code, "detail": str(error), "errors": [], "report": None}
    except MeshRefusedError as error:
        errors = [asdict(defect) for defect in error.errors]
        report = error.report.as_dict() if error.report else None
        return {"code": error.code, "detail": str(error), "errors": errors, "report": report}
    except MemoryError:
        detail = "Reading the mesh takes more memory than a file of this size is given. Decimate it first."
        return {"code": "mesh-too-large", "detail": detail, "errors": [], "report": None}
    np.save(folder / "vertices.npy", result.mesh.vertices, allow_pickle=False)
    np.save(folder / "faces.npy", result.mesh.faces, allow_pickle=False)
    return {"code": None, "report": result.report.as_dict()}


def main() -> None:
    """Serve one request."""
    gc.disable()  # one request, then the end: looking for garbage would only take time
    volunteer_for_lack_of_memory()
    request = json.load(sys.stdin)
    limits = ReadLimits(**request["limits"])
    confine(request["memory"], request["seconds"], 72 * limits.max_faces + MIB)
    said = json.dumps(answer(request, limits))
    (Path(request["folder"]) / "answer.json").write_text(said, encoding="utf-8")


if __name__ == "__main__":
    main()
