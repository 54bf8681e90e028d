"""Every documented problem is produced by a real request, and described at its address."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from urllib.parse import unquote

import httpx
import pytest

import service.intake
from service.problem_types import PROBLEMS
from service.problems import MEDIA_TYPE
from spherify.formats import reading
from spherify.jobs import layout
from spherify.jobs.codec import load_mesh_record
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import Stores, open_stores
from tests.service.conftest import OCTAHEDRON, OPEN, Hand, problem, serve, stretched

FLIPPED = OCTAHEDRON.replace(b"f 1 3 5", b"f 3 1 5")
TWO = (
    OCTAHEDRON
    + b"".join(
        b"v %d %d %d\n" % (x + 9, y, z)
        for x, y, z in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
    )
    + b"".join(
        b"f %d %d %d\n" % tuple(int(i) + 6 for i in line.split()[1:])
        for line in OCTAHEDRON.splitlines()
        if line.startswith(b"f")
    )
)
FIN = OCTAHEDRON + b"v 2 2 2\nf 1 3 7\nf 3 1 7\n"


def torus(n: int = 6) -> bytes:
    """A closed surface with one handle."""
    from math import cos, pi, sin

    angles = [2 * pi * k / n for k in range(n)]
    text = [f"v {(3 + cos(b)) * cos(a)} {(3 + cos(b)) * sin(a)} {sin(b)}" for a in angles for b in angles]
    for i in range(n):
        for j in range(n):
            corner = [(i % n) * n + j % n + 1 for i, j in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
            text += [f"f {corner[0]} {corner[1]} {corner[2]}", f"f {corner[0]} {corner[2]} {corner[3]}"]
    return "\n".join(text).encode()


@dataclass
class World:
    """What a request may need."""

    client: httpx.Client
    odd: httpx.Client  # tiny limits, no patience, one allowed web origin, one name
    full: httpx.Client  # no space left
    lost: httpx.Client  # no server behind it
    submit: Callable[..., Hand]
    stores: Stores
    patch: pytest.MonkeyPatch

    def put(self, data: bytes, name: str = "a.obj") -> httpx.Response:
        return self.client.put("/v1/meshes", params={"name": name}, content=data)


@pytest.fixture(scope="session")
def others(shared_settings: Settings, shared_stores: Stores) -> Iterator[tuple[httpx.Client, ...]]:
    odd = {"max_vertices": 5, "upload_timeout_s": 0.2, "cors_origins": ["https://good.example"]}
    odd |= {"allowed_hosts": ["good.example"]}
    lost = shared_settings.model_copy(update={"redis_url": "redis://127.0.0.1:1/0"})
    lost_stores = open_stores(lost)
    with (
        serve(shared_settings.model_copy(update=odd), shared_stores) as odd_url,
        serve(shared_settings.model_copy(update={"min_free_bytes": 2**62}), shared_stores) as full_url,
        serve(lost, lost_stores) as lost_url,
        httpx.Client(base_url=odd_url) as first,
        httpx.Client(base_url=full_url) as second,
        httpx.Client(base_url=lost_url) as third,
    ):
        yield first, second, third
    lost_stores.close()


@pytest.fixture
def world(
    client: httpx.Client,
    others: tuple[httpx.Client, httpx.Client, httpx.Client],
    submitted: Callable[..., Hand],
    stores: Stores,
    monkeypatch: pytest.MonkeyPatch,
) -> World:
    return World(client, *others, submitted, stores, monkeypatch)


def stalled(world: World) -> httpx.Response:
    """A body of which half comes, and the rest only once the answer is there."""

    def pieces() -> Iterator[bytes]:
        yield OCTAHEDRON[:50]
        request_done.wait(10)

    import threading

    request_done = threading.Event()
    with httpx.Client(base_url=world.odd.base_url) as client:
        timer = threading.Timer(1.0, request_done.set)
        timer.start()
        answer = client.put("/v1/meshes?name=a.obj", content=pieces())
        timer.cancel()
        request_done.set()
        timer.join()
    return answer


def overloaded(world: World) -> httpx.Response:
    world.patch.setattr(service.intake, "WAITING", 0)
    return world.put(OCTAHEDRON + b"# one too many\n")


def damaged(world: World) -> httpx.Response:
    hand = world.submit().claim().reach(0)
    path = world.stores.blobs.root / hand.job().snapshots[0].key
    path.write_bytes(path.read_bytes()[:-300])
    return world.client.get(f"/v1/jobs/{hand.job_id}/snapshots/0.ply")


def of_another_form(world: World) -> httpx.Response:
    hand = world.submit()
    world.stores.client.hset(keys.job(hand.job_id), "spec", "{")
    return world.client.get(f"/v1/jobs/{hand.job_id}/snapshots/0.ply")


def snapshot(world: World, which: str, **headers: str) -> httpx.Response:
    hand = world.submit().claim().reach(0)
    return world.client.get(f"/v1/jobs/{hand.job_id}/snapshots/{which}", headers=headers)


def finished(world: World) -> str:
    return f"/v1/jobs/{world.submit().claim().reach(0).end().job_id}"


def deleted(world: World) -> httpx.Response:
    url = finished(world)
    assert world.client.delete(url).status_code == 204
    return world.client.get(url)


def keyed(world: World, iterations: str) -> httpx.Response:
    return world.client.post(
        "/v1/jobs",
        files={"file": ("o.obj", OCTAHEDRON)},
        data={"iterations": iterations},
        headers={"Idempotency-Key": "k"},
    )


def reused(world: World) -> httpx.Response:
    assert keyed(world, "1").status_code == 201
    return keyed(world, "2")


def in_progress(world: World) -> httpx.Response:
    with world.patch.context() as patch:
        patch.setattr(world.stores.repeats, "answered", lambda *_: None)  # it never comes to that
        assert keyed(world, "1").status_code == 201
    return keyed(world, "1")


PRODUCERS: dict[str, Callable[[World], httpx.Response]] = {
    "malformed-multipart": lambda w: w.client.post(
        "/v1/jobs", content=b"x", headers={"Content-Type": "multipart/form-data"}
    ),
    "malformed-json": lambda w: w.client.post(
        "/v1/jobs", content=b"{", headers={"Content-Type": "application/json"}
    ),
    "malformed-request": lambda w: w.odd.options(
        "/v1/jobs", headers={"Origin": "https://evil.example", "Access-Control-Request-Method": "POST"}
    ),
    "digest-mismatch": lambda w: w.client.put(
        "/v1/meshes?name=a.obj", content=OCTAHEDRON, headers={"Content-Digest": "sha-256=:AAAA:"}
    ),
    "cross-site": lambda w: w.client.post("/v1/jobs", headers={"Sec-Fetch-Site": "cross-site"}),
    "not-found": lambda w: w.client.get("/v2/jobs"),
    "result-not-ready": lambda w: snapshot(w, "500.ply"),
    "method-not-allowed": lambda w: w.client.patch("/v1/jobs"),
    "not-acceptable": lambda w: snapshot(w, "0", Accept="image/png"),
    "request-timeout": stalled,
    "idempotency-in-progress": in_progress,
    "idempotency-key-reused": reused,
    "job-already-finished": lambda w: w.client.post(finished(w) + "/cancel"),
    "job-cannot-go-on": lambda w: w.client.post(finished(w) + "/retry"),
    "job-not-finished": lambda w: w.client.delete(f"/v1/jobs/{w.submit().job_id}"),
    "mesh-in-use": lambda w: w.client.delete(f"/v1/meshes/{w.submit().job().spec.mesh_id}"),
    "gone": deleted,
    "precondition-failed": lambda w: w.client.delete(finished(w), headers={"If-Match": '"nope"'}),
    "upload-too-large": lambda w: w.put(b"#" * 2_000_001),
    "mesh-too-large": lambda w: w.odd.put("/v1/meshes?name=a.obj", content=OCTAHEDRON + b"# other\n"),
    "address-too-long": lambda w: w.client.get("/v1/jobs/" + "é" * 4000),
    "unsupported-media-type": lambda w: w.client.post("/v1/jobs", content=b"x"),
    "unsupported-mesh-format": lambda w: w.put(b"%PDF-1.7\n", "a.pdf"),
    "range-not-satisfiable": lambda w: snapshot(w, "0.ply", Range="bytes=999999-"),
    "unknown-host": lambda w: w.odd.get("/v1/jobs", headers={"Host": "evil.example"}),
    "invalid-parameters": lambda w: w.client.get("/v1/jobs?limit=0"),
    "mesh-not-parsable": lambda w: w.put(b"v 1 2 x\nf 1 1 1\n"),
    "mesh-not-closed": lambda w: w.put(OPEN),
    "mesh-not-manifold": lambda w: w.put(FIN),
    "mesh-not-oriented": lambda w: w.put(FLIPPED),
    "mesh-not-connected": lambda w: w.put(TWO),
    "mesh-genus": lambda w: w.put(torus()),
    "headers-too-large": lambda w: w.client.get("/v1/jobs", headers={"X": "x" * 66_000}),
    "rate-limited": overloaded,
    "internal-error": of_another_form,
    "stored-file-damaged": damaged,
    "not-ready": lambda w: w.lost.get("/v1/jobs"),
    "storage-full": lambda w: w.full.put("/v1/meshes?name=a.obj", content=OCTAHEDRON),
}


def test_every_problem_has_a_producer() -> None:
    assert set(PRODUCERS) == set(PROBLEMS)


@pytest.mark.parametrize("slug", PROBLEMS)
def test_a_problem_is_produced_as_documented(world: World, slug: str) -> None:
    kind = PROBLEMS[slug]
    answer = PRODUCERS[slug](world)
    document = problem(answer, kind.status, slug)
    assert document["title"] == kind.title
    asked = answer.request.url.path
    assert unquote(str(document["instance"])) == (asked if len(asked) < 200 else asked[:200] + "…")
    assert ("retry-after" in answer.headers) == (kind.retry_after_s is not None)
    page = world.client.get(kind.uri)
    assert page.status_code == 200
    assert kind.slug in page.text
    assert f'href="{kind.uri}"' in world.client.get("/problems").text


@pytest.mark.parametrize("slug", ["internal-error", "stored-file-damaged"])
def test_no_secret_of_ours_is_told(world: World, slug: str) -> None:
    document = problem(PRODUCERS[slug](world), 500, slug)
    assert "npz" not in str(document)
    assert "Traceback" not in str(document)


def test_what_is_damaged_is_named_with_the_cure(world: World) -> None:
    answer = damaged(world)
    job_id = answer.request.url.path.split("/")[3]
    detail = problem(answer, 500, "stored-file-damaged")["detail"]
    assert detail == f"the snapshot of iteration 0 of {job_id} is damaged: delete the job and send it again"


def test_a_damaged_mesh_is_made_whole_as_its_problem_says(world: World) -> None:
    path = world.put(OCTAHEDRON + b"# to be damaged").headers["location"]
    mesh_id = path.rpartition("/")[2]
    arrays = world.stores.blobs.root / layout.mesh_arrays(mesh_id)
    arrays.write_bytes(arrays.read_bytes()[:-300])
    document = problem(world.client.get(f"{path}/content.ply"), 500, "stored-file-damaged")
    assert f"the stored mesh {mesh_id} is damaged: delete it" in document["detail"]
    assert world.client.delete(path).status_code == 204
    assert world.put(OCTAHEDRON + b"# to be damaged").headers["location"] == path
    assert world.client.get(f"{path}/content.ply").status_code == 200


@pytest.mark.parametrize("damage", ["cut", "changed", "format", "nothing", "no object"])
def test_a_mesh_whose_record_was_lost_and_is_damaged_is_made_whole_by_an_upload(
    world: World, damage: str
) -> None:
    content = b"# " + damage.encode() + b"\n" + OCTAHEDRON
    path = world.put(content).headers["location"]
    mesh_id = path.rpartition("/")[2]
    file = world.stores.blobs.root / layout.mesh_record(mesh_id)
    whole = file.read_bytes()
    damaged = {
        "cut": whole[:-9],
        "changed": whole.replace(b'"size":', b'"size":1'),
        "format": whole.replace(b'"format":"obj"', b'"format":"obk"'),
        "nothing": b"",
        "no object": b"[]",
    }
    file.write_bytes(damaged[damage])
    world.stores.meshes.delete(mesh_id)  # the record alone
    problem(world.client.get(path), 404, "not-found")
    assert world.put(content).headers["location"] == path
    document = world.client.get(path).json()
    assert document["size"] == len(content)
    assert world.client.get(f"{path}/content").content == content
    assert load_mesh_record(file.read_bytes()) == world.stores.meshes.get(mesh_id)


def test_a_mesh_whose_record_was_lost_and_is_damaged_can_be_deleted(world: World) -> None:
    path = world.put(OCTAHEDRON + b"# to be deleted").headers["location"]
    mesh_id = path.rpartition("/")[2]
    (world.stores.blobs.root / layout.mesh_record(mesh_id)).write_bytes(b"damaged")
    world.stores.meshes.delete(mesh_id)  # the record alone
    assert world.client.delete(path).status_code == 204
    assert list(world.stores.blobs.list(layout.mesh_folder(mesh_id))) == []
    problem(world.client.delete(path), 404, "not-found")


def test_an_unknown_problem_is_not_found(client: httpx.Client) -> None:
    problem(client.get("/problems/boredom"), 404, "not-found")


@pytest.mark.parametrize(
    ("path", "method", "allowed"),
    [
        ("/v1/jobs", "PUT", "GET, HEAD, POST"),
        ("/v1/meshes", "DELETE", "GET, HEAD, POST, PUT"),
        ("/v1/jobs/job_x", "POST", "DELETE, GET, HEAD"),
        ("/v1/jobs/job_x/cancel", "GET", "POST"),
        ("/v1/jobs/job_x/cancel", "HEAD", "POST"),
        ("/v1/jobs/job_x/snapshots/1.ply", "DELETE", "GET, HEAD"),
        ("/healthz", "TRACE", "GET, HEAD"),
        ("/", "POST", "GET, HEAD"),
    ],
)
def test_other_methods_are_told_which_are_allowed(
    client: httpx.Client, path: str, method: str, allowed: str
) -> None:
    answer = client.request(method, path)
    assert answer.status_code == PROBLEMS["method-not-allowed"].status
    assert answer.headers["allow"] == allowed
    assert answer.headers["content-type"] == MEDIA_TYPE


@pytest.mark.parametrize(
    "path", ["/v1/jobs/", "//v1/jobs", "/v1", "/%00", "/%ff%fe", "/v1/jobs/../../etc/passwd", "/é"]
)
def test_unknown_addresses_are_not_found(client: httpx.Client, path: str) -> None:
    document = problem(client.get(path), 404, "not-found")
    assert str(document["instance"]).isascii()


def test_every_store_that_is_lost_is_said_so_at_once(world: World) -> None:
    job, mesh = "job_" + "0" * 26, "mesh_" + "0" * 26
    for method, path in (
        ("GET", f"/v1/jobs/{job}"),
        ("DELETE", f"/v1/jobs/{job}"),
        ("POST", f"/v1/jobs/{job}/cancel"),
        ("GET", f"/v1/jobs/{job}/snapshots/0.ply"),
        ("GET", f"/v1/jobs/{job}/metrics.csv"),
        ("GET", "/v1/meshes"),
        ("GET", f"/v1/meshes/{mesh}/content"),
    ):
        answer = world.lost.request(method, path)
        problem(answer, 503, "not-ready")
        assert answer.headers["retry-after"]
    answer = world.lost.post("/v1/jobs", files={"file": ("o.obj", OCTAHEDRON)})
    problem(answer, 503, "not-ready")


def test_a_mesh_whose_reading_was_killed_is_to_be_sent_again(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the kernel does where the memory runs out."""
    file = {"file": ("o.obj", stretched(1.875))}
    killed = (sys.executable, "-c", "import os; os.kill(os.getpid(), 9)")
    with monkeypatch.context() as patch:
        patch.setattr(reading, "_COMMAND", killed)
        answer = client.post("/v1/meshes", files=file)
    document = problem(answer, 503, "not-ready")
    assert "Send it again" in str(document["detail"])
    assert answer.headers["retry-after"]
    assert client.post("/v1/meshes", files=file).status_code == 201
