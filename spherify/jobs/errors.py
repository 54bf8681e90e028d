"""Errors of the jobs and their stores.

JobsError
├── StoreUnavailableError   the server does not answer
├── StorageFullError        no space for a blob
├── BlobExistsError
├── DamagedBlobError        it is not what was written
├── NotFoundError
│   ├── JobNotFoundError
│   ├── JobGoneError        it existed and was deleted
│   ├── MeshNotFoundError
│   └── BlobNotFoundError
├── ConflictError
│   ├── JobNotFinishedError
│   ├── JobCannotGoOnError
│   ├── MeshInUseError
│   ├── KeyReusedError
│   └── RequestInProgressError
└── InvalidCursorError
"""


class JobsError(Exception):
    """Something about a job, a mesh or their storage."""


class StoreUnavailableError(JobsError):
    """The job store does not answer."""


class StorageFullError(JobsError):
    """There is no space left to store this."""


class BlobExistsError(JobsError):
    """This key is written already, and blobs are written once."""


class DamagedBlobError(JobsError):
    """What is stored under this key is not what was written."""


class NotFoundError(JobsError):
    """There is nothing of this name."""


class JobNotFoundError(NotFoundError):
    """There is no job of this name."""


class JobGoneError(NotFoundError):
    """This job was deleted."""


class MeshNotFoundError(NotFoundError):
    """There is no mesh of this name."""


class BlobNotFoundError(NotFoundError):
    """There is no blob under this key."""


class ConflictError(JobsError):
    """The state it is in forbids this."""


class JobNotFinishedError(ConflictError):
    """The job is not finished: cancel it first."""


class JobCannotGoOnError(ConflictError):
    """Going on from where this job ended would lead nowhere else."""


class MeshInUseError(ConflictError):
    """A job names this mesh: delete the job first."""


class KeyReusedError(ConflictError):
    """This Idempotency-Key came with another request before: take a new key for a new request."""


class RequestInProgressError(ConflictError):
    """A request with this Idempotency-Key is being carried out: ask again in a moment."""


class InvalidCursorError(JobsError):
    """This cursor was not given out by this listing."""
