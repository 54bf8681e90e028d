"""Every variable that configures the service and the worker, with its meaning.

Names are upper case with the prefix ``SPHERIFY_``; ``REDIS_URL`` goes without it, as everybody expects.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AliasChoices, Field, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

MIB = 1024 * 1024
PREFIX = "SPHERIFY_"
# REDIS_URL by another name; where the commands find a service.
_KNOWN_BESIDE = {"SPHERIFY_REDIS_URL", "SPHERIFY_URL"}


class Settings(BaseSettings):
    """The configuration of one process, read from the environment."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        extra="ignore",
        frozen=True,
        populate_by_name=True,
        hide_input_in_errors=True,  # an address may have a password
    )

    redis_url: str = Field(
        default="redis://127.0.0.1:6379/0",
        validation_alias=AliasChoices("REDIS_URL", "SPHERIFY_REDIS_URL"),
        description="Server of the job records and of the queue: redis://, rediss:// or unix://. "
        "`spherify up` starts one of its own when this is not set. `SPHERIFY_REDIS_URL` is another name of it.",
    )
    data_dir: Path = Field(
        default=Path("data"),
        description="Folder for meshes, snapshots and results; all processes must see the same one.",
    )
    blobs: str = Field(
        default="folder",
        pattern=r"^(folder|s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9_-][A-Za-z0-9._-]*)*/?)$",
        description="Where files are kept: `folder`, in the data folder, or `s3://bucket/prefix`; then each host may "
        "have a data folder of its own.",
    )
    max_upload_bytes: int = Field(
        default=256 * MIB, gt=0, description="Largest accepted request body; above it the answer is 413."
    )
    max_vertices: int = Field(default=2_000_000, gt=3, description="Largest accepted mesh, in vertices.")
    max_faces: int = Field(default=4_000_000, gt=3, description="Largest accepted mesh, in triangles.")
    max_iterations: int = Field(default=1_000_000, gt=0, description="Most iterations a job may ask for.")
    min_free_bytes: int = Field(
        default=64 * MIB,
        ge=0,
        description="Uploads are refused with 507 when the data folder has less free space than this and the file; "
        "all else goes on, deleting in particular.",
    )
    upload_timeout_s: float = Field(
        default=30.0, gt=0, description="An upload that sends nothing for this long is dropped with 408."
    )
    cors_origins: Annotated[list[str], NoDecode] = Field(
        default=[], description="Web origins that may call the API from a browser, separated by commas."
    )
    allowed_hosts: Annotated[list[str], NoDecode] = Field(
        default=[],
        description="Names under which browsers may ask for the service, beside `localhost` and addresses, without "
        "ports, separated by commas; `*` is any. Unset: any where it listens for other machines too, none where it "
        "listens for its own alone, as `spherify up` does.",
    )
    cache_bytes: int = Field(
        default=1024 * MIB,
        ge=0,
        description="Converted files kept in the data folder to be handed out again, in bytes; more are thrown away.",
    )
    lease_s: float = Field(
        default=30.0,
        ge=1,  # a worker gives up at 0.8 of it, and renews every half second, give or take a quarter
        description="A worker that does not renew its lease for this long has lost its job; it renews twice a second.",
    )
    heartbeat_s: float = Field(
        default=5.0,
        gt=0,
        le=30,  # so that three in a row may get lost
        description="How often a worker tells the queue that it is still at a job; after 120 s without that, the queue "
        "delivers the job once more.",
    )
    reconcile_s: float = Field(
        default=5.0, gt=0, description="How often lost and unsent jobs are looked for."
    )
    orphan_s: float = Field(
        default=15.0, gt=0, description="A waiting job that no queue holds is sent again after this long."
    )
    watchdog_s: float = Field(
        default=20.0,
        ge=5,
        description="A worker that fetches nothing although it could ends after this long, to be started again.",
    )
    max_losses: int = Field(
        default=3, ge=0, description="A job whose worker is lost more often than this fails."
    )
    cancel_grace_s: float = Field(
        default=5.0, gt=0, description="A runner told to stop is killed after this long."
    )
    wall_limit_s: float = Field(
        default=6 * 3600.0,
        gt=0,
        description="A job ends with `deadline` after this long at work, all its attempts together.",
    )
    checkpoint_s: float = Field(
        default=60.0, gt=0, description="A run keeps its state at least this often, to go on from."
    )
    runner_memory_bytes: int = Field(
        default=4096 * MIB, gt=0, description="Address space of one runner; a job that needs more fails."
    )
    engine: Literal["auto", "reference", "compiled"] = Field(
        default="auto",
        description="Engine that computes new jobs: `compiled` (machine code by numba), `reference` (numpy alone, "
        "slower), or `auto`, which is `compiled` where numba is installed. A job stays with the engine it began with.",
    )
    threads: int = Field(default=1, ge=1, description="Threads one runner computes with.")

    @field_validator("cors_origins", "allowed_hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        return (
            [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value
        )

    @field_validator("redis_url")
    @classmethod
    def _address(cls, value: str) -> str:
        if value and not _is_server(value):  # an empty one is none
            raise ValueError("it is no address of a server: write it as in redis://127.0.0.1:6379/0")
        return value

    @property
    def url_without_password(self) -> str:
        """`redis_url` fit for messages."""
        scheme, _, rest = self.redis_url.partition("://")
        return f"{scheme}://{rest.rpartition('@')[2]}"


def _is_server(url: str) -> bool:
    try:
        parts = urlsplit(url)
        _ = parts.port  # raises, as the next one, where it is no number
        if parts.scheme in {"redis", "rediss"}:
            int(parts.path.strip("/") or 0)  # the database
    except ValueError:
        return False
    return parts.scheme in {"redis", "rediss", "unix"}


def unknown_variables(environment: Mapping[str, str]) -> list[str]:
    """Return a sentence on each variable that looks like a setting and is none: it may be misspelt."""
    known = {f"{PREFIX}{name.upper()}" for name in Settings.model_fields} | _KNOWN_BESIDE
    found = sorted(name for name in environment if name.startswith(PREFIX) and name not in known)
    return [f"{name} is no setting, and does nothing{_meant(name, known)}" for name in found]


def _meant(name: str, known: Collection[str]) -> str:
    alike = get_close_matches(name, known, n=1, cutoff=0.8)
    return f": is {alike[0]} meant?" if alike else ""
