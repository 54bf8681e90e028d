"""Where the files are, from one word of the settings: also for processes that know nothing of servers."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from spherify.jobs.ports import BlobStore
from spherify.stores.blobs import FolderBlobStore

PATIENCE_S: Final = 12.0  # three answers that never come


def open_blobs(where: str, folder: Path, *, patience_s: float = PATIENCE_S) -> BlobStore:
    """Return the store of the files; nothing is sent before its first use.

    Args:
        where: `Settings.blobs`: ``folder``, or ``s3://bucket/prefix``.
        folder: for the files, and for unfinished ones in any case.
        patience_s: how long a call is repeated while a server does not answer.

    Raises:
        ModuleNotFoundError: a bucket is named, and its client is not installed.

    """
    if where == "folder":
        return FolderBlobStore(folder)
    try:
        from spherify.stores.s3_blobs import S3BlobStore  # noqa: PLC0415 (an extra: most have a folder)
    except ModuleNotFoundError as e:
        raise ModuleNotFoundError(f"{where} needs the client for S3: pip install 'spherify[s3]'") from e
    return S3BlobStore(where, folder / ".scratch", patience_s=patience_s)
