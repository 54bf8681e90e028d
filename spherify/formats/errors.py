"""Errors of reading and writing meshes.

FormatError
├── MeshRefusedError    a file that is no mesh we can morph; says why, where, and what to do
├── UnreadableError     the same inside the reading process, before there is a report
│   └── TooLargeError   more than the limits let in
└── InvalidExportError  a format or an option that cannot be written

OSError
└── ReaderKilledError   the reading process was killed, most likely for lack of memory; the file is not to blame
"""

from __future__ import annotations

from spherify.formats.codes import ProblemCode
from spherify.formats.report import Defect, MeshReport


class FormatError(ValueError):
    """A mesh cannot be read or written."""


class UnreadableError(FormatError):
    """The content cannot be turned into vertices and faces.

    Attributes:
        code: the problem it is, as the interface names it.

    """

    def __init__(self, detail: str, code: ProblemCode = "mesh-not-parsable") -> None:
        super().__init__(detail)
        self.code: ProblemCode = code


class TooLargeError(UnreadableError):
    """The file holds, or claims, more than the limits let in."""

    def __init__(self, detail: str) -> None:
        super().__init__(detail, "mesh-too-large")


class InvalidExportError(FormatError):
    """There is no such format to write, or it has no such option."""


class ReaderKilledError(OSError):
    """The reading process was killed from outside: the machine ran out of memory, most likely."""


class MeshRefusedError(FormatError):
    """The file is no mesh that can be morphed; the message names the first defect and its cure.

    Attributes:
        code: the problem it is, as the interface names it.
        errors: every defect that was found, the first one being ``code``.
        report: what could be measured, None if the file could not be read at all.

    """

    def __init__(
        self,
        code: ProblemCode,
        detail: str,
        errors: tuple[Defect, ...] = (),
        report: MeshReport | None = None,
    ) -> None:
        super().__init__(detail)
        self.code: ProblemCode = code
        self.errors = errors
        self.report = report
