"""What becomes of an answer whose files are replaced or deleted while it is made, or damaged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import httpx
import pytest

from spherify.jobs import layout
from spherify.jobs.delete import delete_job, delete_mesh
from spherify.jobs.ports import BlobStat
from spherify.jobs.settle import settle
from spherify.settings import Settings
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, Hand, problem, serve

STATES = ["snapshots/0.ply", "snapshots/0/positions", "snapshots/0/fields/distance", "snapshots/initial"]


class Interrupted(FolderBlobStore):
    """Files that are read for the first time only after something else has happened."""

    def open(self, key: str) -> BinaryIO:
        self._wait()
        return super().open(key)

    def copy(self, source: str, key: str) -> BlobStat:
        self._wait()
        return super().copy(source, key)

    def _wait(self) -> None:
        happen, self.happen = self.happen, lambda: None
        happen()

    happen: Callable[[], object] = staticmethod(lambda: None)


@dataclass
class Interruption:
    client: httpx.Client
    blobs: Interrupted

    def get_when(self, path: str, happen: Callable[[], object]) -> httpx.Response:
        self.blobs.happen = happen
        return self.client.get(path, headers={"Accept": "application/ply, application/octet-stream"})


@pytest.fixture
def interrupted(settings: Settings, stores: Stores) -> Iterator[Interruption]:
    blobs = Interrupted(stores.blobs.scratch().parent)
    with (
        serve(settings, replace(stores, blobs=blobs)) as url,
        httpx.Client(base_url=url, timeout=30) as client,
    ):
        yield Interruption(client, blobs)


@pytest.mark.parametrize("state", STATES)
def test_a_state_that_a_later_attempt_made_again_is_answered(
    interrupted: Interruption, submitted: Callable[..., Hand], state: str
) -> None:
    hand = submitted().claim().reach(0)
    former = hand.job().snapshots[0].key

    def made_again() -> None:
        assert hand.stores.jobs.lose(hand.job_id, hand.token)
        hand.claim().reach(0).end()
        settle(hand.stores.jobs, hand.stores.blobs, hand.job_id)
        assert hand.stores.blobs.stat(former) is None

    answer = interrupted.get_when(f"/v1/jobs/{hand.job_id}/{state}", made_again)
    assert answer.status_code == 200, answer.text
    assert answer.content


@pytest.mark.parametrize("path", [*STATES, "archive.zip", "topology"])
def test_of_a_job_that_was_deleted_meanwhile_it_is_said_so(
    interrupted: Interruption, submitted: Callable[..., Hand], path: str
) -> None:
    hand = submitted().claim().reach(0).end()
    mesh_id = hand.job().spec.mesh_id

    def deleted() -> None:
        delete_job(hand.stores.jobs, hand.stores.blobs, hand.job_id)
        delete_mesh(hand.stores.meshes, hand.stores.blobs, mesh_id)

    problem(interrupted.get_when(f"/v1/jobs/{hand.job_id}/{path}", deleted), 410, "gone")


def test_a_job_that_was_deleted_meanwhile_is_not_gone_on_with(
    interrupted: Interruption, submitted: Callable[..., Hand]
) -> None:
    hand = submitted().claim().reach(0).end()
    interrupted.blobs.happen = lambda: delete_job(hand.stores.jobs, hand.stores.blobs, hand.job_id)
    answer = interrupted.client.post(f"/v1/jobs/{hand.job_id}/extend", json={"iterations": 10})
    problem(answer, 410, "gone")


@pytest.mark.parametrize("path", ["content", "content.ply", "topology"])
def test_of_a_mesh_that_was_deleted_meanwhile_it_is_said_so(
    interrupted: Interruption, stores: Stores, known: str, path: str
) -> None:
    answer = interrupted.get_when(
        f"/v1/meshes/{known}/{path}", lambda: delete_mesh(stores.meshes, stores.blobs, known)
    )
    assert known in str(problem(answer, 404, "not-found")["detail"])


@pytest.mark.parametrize("path", [*STATES, "archive.zip"])
def test_a_state_whose_file_is_missing_is_named_with_the_cure(
    client: httpx.Client, submitted: Callable[..., Hand], path: str
) -> None:
    hand = submitted().claim().reach(0).end()
    assert hand.stores.blobs.delete(hand.job().snapshots[0].key)
    answer = client.get(f"/v1/jobs/{hand.job_id}/{path}", headers={"Accept": "application/ply, */*;q=0.1"})
    detail = problem(answer, 500, "stored-file-damaged")["detail"]
    which = f"the snapshot of iteration 0 of {hand.job_id}"
    assert detail == f"{which} is missing: delete the job and send it again"


def test_a_job_of_which_a_file_is_missing_cannot_be_gone_on_with(
    client: httpx.Client, submitted: Callable[..., Hand]
) -> None:
    hand = submitted().claim().reach(0).end()
    assert hand.stores.blobs.delete(hand.job().snapshots[0].key)
    answer = client.post(f"/v1/jobs/{hand.job_id}/extend", json={"iterations": 10})
    assert f"a state of {hand.job_id} is missing" in str(
        problem(answer, 500, "stored-file-damaged")["detail"]
    )


@pytest.mark.parametrize(("path", "what"), [("content", "uploaded file of"), ("content.ply", "stored mesh")])
def test_a_mesh_whose_file_is_missing_is_named_with_the_cure_which_helps(
    client: httpx.Client, stores: Stores, known: str, path: str, what: str
) -> None:
    for key in (layout.mesh_arrays(known), layout.mesh_original(known, "obj")):
        assert stores.blobs.delete(key)
    detail = problem(client.get(f"/v1/meshes/{known}/{path}"), 500, "stored-file-damaged")["detail"]
    assert detail == f"the {what} {known} is missing: upload it again"
    assert client.put("/v1/meshes?name=octahedron.obj", content=OCTAHEDRON).status_code == 200
    assert client.get(f"/v1/meshes/{known}/{path}").status_code == 200


@pytest.mark.parametrize("path", STATES)
def test_a_damaged_file_of_the_cache_is_broken_off_and_made_anew(
    client: httpx.Client, settings: Settings, submitted: Callable[..., Hand], path: str
) -> None:
    hand = submitted().claim().reach(0).end()
    address = f"/v1/jobs/{hand.job_id}/{path}"
    accept = {"Accept": "application/ply, */*;q=0.1"}
    whole = client.get(address, headers=accept).content
    (cached,) = (settings.data_dir / "cache").iterdir()
    damage(cached)
    with pytest.raises(httpx.RemoteProtocolError):
        client.get(address, headers=accept)
    assert client.get(address, headers=accept).content == whole


@pytest.mark.parametrize("shorter", [False, True])
def test_a_damaged_upload_is_broken_off(
    client: httpx.Client, stores: Stores, settings: Settings, known: str, shorter: bool
) -> None:
    damage(settings.data_dir / "blobs" / layout.mesh_original(known, "obj"), shorter=shorter)
    with pytest.raises(httpx.RemoteProtocolError):
        client.get(f"/v1/meshes/{known}/content")


def damage(path: Path, *, shorter: bool = False) -> None:
    content = bytearray(path.read_bytes())
    if shorter:
        del content[-1]
    else:
        content[0] ^= 1
    path.write_bytes(content)
