from __future__ import annotations

import hashlib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import httpx
import pytest

from spherify.jobs import layout
from spherify.jobs.errors import StorageFullError
from spherify.jobs.ports import BlobStat
from spherify.jobs.rebuild import rebuild
from spherify.settings import Settings
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, OPEN, data_files, problem, serve, stretched
from tests.shared import shared_mesh


def upload(
    client: httpx.Client, data: bytes = OCTAHEDRON, name: str = "octahedron.obj", **fields: object
) -> httpx.Response:
    return client.post("/v1/meshes", files={"file": (name, data)}, data=fields)


def test_an_uploaded_mesh_is_described(client: httpx.Client) -> None:
    answer = upload(client)
    assert answer.status_code == 201
    mesh = answer.json()
    assert answer.headers["location"] == f"/v1/meshes/{mesh['id']}" == mesh["links"]["self"]
    assert mesh["name"] == "octahedron.obj"
    assert mesh["sha256"] == hashlib.sha256(OCTAHEDRON).hexdigest()
    assert mesh["size"] == len(OCTAHEDRON)
    assert (mesh["report"]["vertices"], mesh["report"]["faces"], mesh["report"]["genus"]) == (6, 8, 0)
    assert mesh["report"]["eligible"] is True
    assert client.get(mesh["links"]["self"]).json() == mesh


def test_the_same_bytes_are_the_same_mesh(client: httpx.Client) -> None:
    first = upload(client)
    again = client.put("/v1/meshes", params={"name": "other.obj"}, content=OCTAHEDRON)
    assert again.status_code == 200
    assert again.json() == first.json()
    with_switch = upload(client, allow="genus")
    assert with_switch.status_code == 201
    assert with_switch.json()["id"] != first.json()["id"]


def test_a_name_must_agree_whether_or_not_the_bytes_are_known(client: httpx.Client) -> None:
    def refusal() -> object:
        answer = client.put("/v1/meshes", params={"name": "octahedron.PLY"}, content=OCTAHEDRON)
        return problem(answer, 415, "unsupported-mesh-format")["detail"]

    unknown = refusal()
    assert unknown == "The file is named .ply, but its content is OBJ. Name it .obj, or export it as PLY."
    assert upload(client).status_code == 201
    assert refusal() == unknown
    for name in ("octahedron.obj", "octahedron", "octahedron.mesh"):
        assert upload(client, name=name).status_code == 200


def test_many_uploads_of_one_mesh_at_once_are_one_mesh(client: httpx.Client, stores: Stores) -> None:
    with ThreadPoolExecutor(6) as pool:
        answers = list(pool.map(lambda _: upload(client), range(6)))
    assert {answer.status_code for answer in answers} <= {200, 201}
    assert len({answer.text for answer in answers}) == 1
    assert len(client.get("/v1/meshes").json()["items"]) == 1
    assert len(data_files(stores.blobs.root)) == 3


def test_the_record_survives_the_loss_of_the_store(client: httpx.Client, stores: Stores) -> None:
    first = upload(client).json()
    path = f"/v1/meshes/{first['id']}"
    stores.client.flushdb()
    for answer in (client.get(path), client.get("/v1/meshes"), client.delete(path), client.get("/readyz")):
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "2"), answer.text  # and never 404
    assert rebuild(stores.stock)
    assert client.get(path).json() == first
    assert upload(client, name="renamed.obj").status_code == 200


def test_a_raw_body_is_read_in_pieces(client: httpx.Client) -> None:
    pieces = (OCTAHEDRON[start : start + 7] for start in range(0, len(OCTAHEDRON), 7))
    answer = client.put("/v1/meshes?name=o.obj", content=pieces)
    assert answer.status_code == 201
    assert answer.json()["size"] == len(OCTAHEDRON)


def test_listing_by_cursor_visits_every_mesh_once(client: httpx.Client) -> None:
    ids = [upload(client, stretched(factor)).json()["id"] for factor in (2, 3, 4)]
    first = client.get("/v1/meshes", params={"limit": 2})
    assert [mesh["id"] for mesh in first.json()["items"]] == ids[:0:-1]
    assert first.links["next"]["url"] == first.json()["links"]["next"]
    second = client.get(first.links["next"]["url"])
    assert [mesh["id"] for mesh in second.json()["items"]] == ids[:1]
    assert "next" not in second.links
    assert second.json()["next_cursor"] is None


def test_content_is_the_upload_byte_for_byte(client: httpx.Client) -> None:
    mesh = upload(client).json()
    answer = client.get(mesh["links"]["content"])
    assert answer.content == OCTAHEDRON
    assert answer.headers["etag"] == f'"{mesh["sha256"]}"'
    assert answer.headers["content-type"] == "model/obj"
    assert answer.headers["content-disposition"] == 'attachment; filename="octahedron.obj"'
    assert "immutable" in answer.headers["cache-control"]


@pytest.mark.parametrize("form", ["obj", "ply", "stl", "off", "glb"])
def test_content_in_another_format_reads_back_as_the_same_mesh(client: httpx.Client, form: str) -> None:
    mesh = upload(client).json()
    written = client.get(f"/v1/meshes/{mesh['id']}/content.{form}")
    assert written.status_code == 200
    again = upload(client, written.content, f"again.{form}").json()
    assert (again["report"]["vertices"], again["report"]["faces"]) == (6, 8)
    assert again["report"]["volume"] == pytest.approx(mesh["report"]["volume"], rel=1e-6)


def test_a_deleted_mesh_is_gone_with_its_files(client: httpx.Client, stores: Stores) -> None:
    mesh = upload(client).json()
    assert client.delete(mesh["links"]["self"]).status_code == 204
    problem(client.get(mesh["links"]["self"]), 404, "not-found")
    problem(client.delete(mesh["links"]["self"]), 404, "not-found")
    assert data_files(stores.blobs.root) == set()


def test_a_mesh_that_a_job_names_stays(client: httpx.Client) -> None:
    mesh = upload(client).json()
    assert client.post("/v1/jobs", json={"mesh_id": mesh["id"]}).status_code == 201
    problem(client.delete(mesh["links"]["self"]), 409, "mesh-in-use")
    assert client.get(mesh["links"]["self"]).status_code == 200


def test_a_refused_mesh_is_explained_and_leaves_nothing(client: httpx.Client, stores: Stores) -> None:
    document = problem(upload(client, OPEN), 422, "mesh-not-closed")
    report = document["report"]
    assert isinstance(report, dict)
    assert report["boundary_edges"] == 3
    errors = document["errors"]
    assert isinstance(errors, list)
    assert errors[0]["locations"][0]["kind"] == "edge"
    assert len(errors[0]["locations"][0]["positions"]) == 2
    assert data_files(stores.blobs.root) == set()


def test_a_switch_lets_an_open_mesh_in(client: httpx.Client) -> None:
    for fields in (
        {"allow": "boundary"},
        {"allow": ["genus", "boundary"]},
        {"allow": "boundary, components"},
    ):
        assert upload(client, OPEN, **fields).status_code == 201
    assert client.put("/v1/meshes?name=o.obj&allow=boundary", content=OPEN).status_code == 200


@pytest.mark.parametrize(
    ("name", "status", "slug"),
    [
        ("genus1_kitten.obj", 422, "mesh-genus"),
        ("three_components_dumbbell.obj", 422, "mesh-not-connected"),
        ("nonmanifold_edge_tetrahedra.obj", 422, "mesh-not-manifold"),
        ("zero_face_index.obj", 422, "mesh-not-parsable"),
    ],
)
def test_real_bad_meshes_are_refused(client: httpx.Client, name: str, status: int, slug: str) -> None:
    path = shared_mesh(f"bad/{name}")
    problem(upload(client, path.read_bytes(), name), status, slug)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("../../etc/passwd.obj", "passwd.obj"),
        ("..\\..\\boot.obj", "boot.obj"),
        ("häschen 1.obj", "häschen 1.obj"),
        ("兔子.obj", "兔子.obj"),
        ("a;b$(c)`d`.obj", "a_b_(c)_d_.obj"),
        (".obj", "obj"),
    ],
)
def test_names_are_made_safe(client: httpx.Client, stores: Stores, name: str, kept: str) -> None:
    mesh = client.put("/v1/meshes", params={"name": name}, content=OCTAHEDRON).json()
    assert mesh["name"] == kept
    disposition = client.get(mesh["links"]["content"]).headers["content-disposition"]
    assert disposition.isascii()
    assert '"' not in disposition.removeprefix('attachment; filename="').split('"; filename')[0].rstrip('"')
    assert all(path.startswith(f"meshes/{mesh['id']}/") for path in data_files(stores.blobs.root))


class NearlyFull(FolderBlobStore):
    """A disk with room for the upload and for nothing after it."""

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        raise StorageFullError(f"there is no space left to store {key}")


def test_a_disk_that_fills_up_in_the_middle_keeps_nothing(settings: Settings, stores: Stores) -> None:
    with serve(settings, replace(stores, blobs=NearlyFull(stores.blobs.root))) as url:
        answer = httpx.put(f"{url}/v1/meshes?name=o.obj", content=OCTAHEDRON, timeout=30)
    problem(answer, 507, "storage-full")
    assert data_files(stores.blobs.root) == set()


def test_a_mesh_whose_files_were_lost_is_mended_by_sending_it_again(
    client: httpx.Client, stores: Stores
) -> None:
    mesh = upload(client).json()
    stores.blobs.delete(layout.mesh_arrays(mesh["id"]))
    again = upload(client)
    assert again.status_code == 200
    assert again.json() == mesh
    assert client.get(mesh["links"]["ply"]).status_code == 200


def test_a_long_name_is_shortened_whichever_way_the_mesh_comes(client: httpx.Client) -> None:
    name = "n" * 251 + ".obj"
    raw = client.put(f"/v1/meshes?name={name}", content=stretched(7)).json()
    assert raw["name"] == "n" * 116 + ".obj"
    assert upload(client, stretched(8), name=name).json()["name"] == raw["name"]


@pytest.mark.parametrize(
    ("name", "saved"), [("cat", "cat.obj"), ("cat.png", "cat.png.obj"), ("Cat.OBJ", "Cat.OBJ")]
)
def test_an_upload_is_downloaded_under_a_name_that_tells_its_format(
    client: httpx.Client, name: str, saved: str
) -> None:
    mesh = upload(client, stretched(3), name=name).json()
    header = client.head(mesh["links"]["content"]).headers["content-disposition"]
    assert header == f'attachment; filename="{saved}"'
