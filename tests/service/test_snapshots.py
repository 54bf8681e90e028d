from __future__ import annotations

import csv
import io
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import httpx
import numpy as np
import pytest

from service.arrays import load_mesh
from spherify.formats import read_mesh
from spherify.jobs.model import JobStatus
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, Hand, problem

Submit = Callable[..., Hand]
MEDIA = {
    "obj": "model/obj",
    "ply": "application/ply",
    "stl": "model/stl",
    "off": "text/plain",
    "glb": "model/gltf-binary",
}


@pytest.fixture
def running(submitted: Submit) -> Hand:
    return submitted().claim().reach(0).reach(100)


def url(hand: Hand, which: object = "") -> str:
    return f"/v1/jobs/{hand.job_id}/snapshots" + (f"/{which}" if which != "" else "")


def test_snapshots_are_listed_while_the_job_runs(client: httpx.Client, running: Hand) -> None:
    answer = client.get(url(running))
    listing = answer.json()
    assert listing["done"] is False
    assert listing["requested"] == [0, 100, 500, 1000]
    assert [item["iteration"] for item in listing["items"]] == [0, 100]
    assert answer.headers["retry-after"]
    first = listing["items"][0]
    assert client.get(first["links"]["self"]).json() == first
    assert client.get(first["links"]["ply"]).content.startswith(b"ply\n")


def test_a_snapshot_is_the_stored_state_in_the_order_of_the_mesh(
    client: httpx.Client, running: Hand, stores: Stores, tmp_path: Path
) -> None:
    file = tmp_path / "state.obj"
    file.write_bytes(client.get(url(running, "100.obj")).content)
    read = read_mesh(file, file.name).mesh
    start = load_mesh(stores.blobs, running.job().spec.mesh_id)
    np.testing.assert_array_equal(read.vertices, start.vertices * 101)
    np.testing.assert_array_equal(read.faces, start.faces)


@pytest.mark.parametrize("form", MEDIA)
def test_by_suffix_and_by_accept_the_same_bytes(client: httpx.Client, running: Hand, form: str) -> None:
    by_suffix = client.get(url(running, f"100.{form}"))
    assert by_suffix.status_code == 200
    assert by_suffix.headers["content-type"].split(";")[0] == MEDIA[form]
    assert int(by_suffix.headers["content-length"]) == len(by_suffix.content)
    if form != "off":  # text/plain may be anything: the suffix names it
        by_accept = client.get(url(running, "latest"), headers={"Accept": MEDIA[form]})
        assert by_accept.content == by_suffix.content
        assert by_accept.headers["vary"] == "Accept"
        assert by_accept.headers["etag"] == by_suffix.headers["etag"]


@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        ("*/*", "application/json"),
        ("application/json", "application/json"),
        ("text/html, */*;q=0.1", "application/json"),
        ("model/*", "model/obj"),
        ("application/json;q=0.5, model/stl;q=0.9", "model/stl"),
        ("model/obj;q=0, model/*", "model/stl"),
    ],
)
def test_accept_chooses(client: httpx.Client, running: Hand, accept: str, kind: str) -> None:
    answer = client.get(url(running, 100), headers={"Accept": accept})
    assert answer.headers["content-type"] == kind


@pytest.mark.parametrize("accept", ["image/png", "application/json;q=0", "nonsense"])
def test_what_cannot_be_had_is_not_acceptable(client: httpx.Client, running: Hand, accept: str) -> None:
    problem(client.get(url(running, 100), headers={"Accept": accept}), 406, "not-acceptable")


def test_precision_and_text_are_choices(client: httpx.Client, running: Hand) -> None:
    double = client.get(url(running, "100.ply"))
    single = client.get(url(running, "100.ply"), params={"precision": "float"})
    text = client.get(url(running, "100.ply"), params={"ascii": "1"})
    assert b"property double x" in double.content
    assert b"property float x" in single.content
    assert b"format ascii" in text.content
    assert len({answer.headers["etag"] for answer in (double, single, text)}) == 3
    problem(client.get(url(running, "100.ply?precision=half")), 422, "invalid-parameters")
    problem(client.get(url(running, "100.glb?ascii=1")), 422, "invalid-parameters")


def test_a_known_snapshot_is_not_sent_again(client: httpx.Client, running: Hand) -> None:
    first = client.get(url(running, "100.ply"))
    etag = first.headers["etag"]
    assert not etag.startswith("W/")
    for wanted in (etag, f'"other", {etag}', f"W/{etag}", "*"):
        again = client.get(url(running, "100.ply"), headers={"If-None-Match": wanted})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", etag)
    assert client.get(url(running, "100.ply"), headers={"If-None-Match": '"other"'}).status_code == 200


def test_head_is_get_without_the_body(client: httpx.Client, running: Hand) -> None:
    for path in (
        url(running, "100.ply"),
        url(running, 100),
        f"/v1/jobs/{running.job_id}",
        "/v1/info",
        "/docs",
    ):
        head, get = client.head(path), client.get(path)
        assert (head.status_code, head.content) == (200, b"")
        skip = {"date", "x-request-id"}
        assert {k: v for k, v in head.headers.items() if k not in skip} == {
            k: v for k, v in get.headers.items() if k not in skip
        }
    assert client.head(url(running, "900.ply")).status_code == 404


def test_only_what_cannot_change_is_immutable(client: httpx.Client, running: Hand) -> None:
    def kept(which: str) -> str:
        return client.get(url(running, which)).headers["cache-control"]

    for fixed in ("0", "100.ply", "initial.ply"):
        assert "immutable" in kept(fixed)
    for moving in ("latest.ply", "latest", "best.ply"):
        assert kept(moving) == "private, no-cache"
    running.end()
    for fixed in ("latest.ply", "best.ply", "final.ply"):
        assert "immutable" in kept(fixed)


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("bytes=0-9", slice(0, 10)),
        ("bytes=10-", slice(10, None)),
        ("bytes=-5", slice(-5, None)),
        ("bytes=5-999999999", slice(5, None)),
    ],
)
def test_a_range_is_a_part_of_the_whole(
    client: httpx.Client, running: Hand, asked: str, expected: slice
) -> None:
    whole = client.get(url(running, "100.ply"))
    part = client.get(url(running, "100.ply"), headers={"Range": asked})
    assert part.status_code == 206
    assert part.content == whole.content[expected]
    start, end, _ = expected.indices(len(whole.content))
    assert part.headers["content-range"] == f"bytes {start}-{end - 1}/{len(whole.content)}"


@pytest.mark.parametrize("asked", ["bytes=9-5", "bytes=0-1,5-6", "lines=1-2", "bytes=-", "bytes=a-b"])
def test_what_is_no_single_range_gets_everything(client: httpx.Client, running: Hand, asked: str) -> None:
    assert client.get(url(running, "100.ply"), headers={"Range": asked}).status_code == 200


def test_a_range_of_something_else_gets_everything(client: httpx.Client, running: Hand) -> None:
    etag = client.get(url(running, "100.ply")).headers["etag"]
    headers = {"Range": "bytes=0-3"}
    assert client.get(url(running, "100.ply"), headers=headers | {"If-Range": etag}).status_code == 206
    assert client.get(url(running, "100.ply"), headers=headers | {"If-Range": '"old"'}).status_code == 200


@pytest.mark.parametrize("asked", ["bytes=99999999-", "bytes=-0"])
def test_a_range_behind_the_end_is_refused(client: httpx.Client, running: Hand, asked: str) -> None:
    size = len(client.get(url(running, "100.ply")).content)
    answer = client.get(url(running, "100.ply"), headers={"Range": asked})
    problem(answer, 416, "range-not-satisfiable")
    assert answer.headers["content-range"] == f"bytes */{size}"


@pytest.mark.parametrize(
    ("name", "ascii_part", "extended"),
    [
        ("bunny", "bunny_it00100.ply", ""),
        ("häschen", "h_schen_it00100.ply", "; filename*=UTF-8''h%C3%A4schen_it00100.ply"),
        ('a"; filename="evil.exe', "a__ filename=_evil_it00100.ply", None),
        ("../../etc/passwd", "passwd_it00100.ply", ""),
        ("C:\\con", "con_it00100.ply", ""),
        ("...", "_it00100.ply", None),
    ],
)
def test_the_file_name_tells_and_is_safe(
    client: httpx.Client, submitted: Submit, name: str, ascii_part: str, extended: str | None
) -> None:
    hand = submitted(name=name).claim().reach(100)
    disposition = client.get(url(hand, "100.ply")).headers["content-disposition"]
    assert disposition.isascii()
    assert disposition.count('"') == 2
    assert "/" not in disposition
    assert "\\" not in disposition
    if extended is not None:
        assert disposition == f'attachment; filename="{ascii_part}"{extended}'


def test_jobs_on_scans_that_differ_in_a_dotted_number_are_told_apart(client: httpx.Client) -> None:
    """`scan.1.obj` is the scan `scan.1`, in the job as in its downloads."""
    answer = client.post("/v1/jobs", files={"file": ("scan.1.obj", OCTAHEDRON)}, data={"iterations": "1"})
    job = answer.json()
    assert job["name"] == "scan.1"
    csv_name = client.head(job["links"]["metrics_csv"]).headers["content-disposition"]
    assert csv_name == 'attachment; filename="scan.1_metrics.csv"'


@pytest.mark.parametrize("name", ["x" * 120, "猫" * 120, "🐈é" * 60, "猫" * 60 + "." + "猫" * 59])
def test_a_long_name_loses_neither_its_iteration_nor_its_format(
    client: httpx.Client, submitted: Submit, name: str
) -> None:
    """And fits into the 255 bytes that a file system has for it."""
    hand = submitted(name=name).claim().reach(0).reach(100)
    for iteration in (0, 100):
        header = client.head(url(hand, f"{iteration}.ply")).headers["content-disposition"]
        plain, _, extended = header.removeprefix('attachment; filename="').partition('"')
        for saved in filter(None, (plain, unquote(extended.removeprefix("; filename*=UTF-8''")))):
            assert saved.endswith(f"_it{iteration:05d}.ply")
            assert len(saved.encode()) <= 255


def test_what_is_not_reached_yet_is_not_ready(client: httpx.Client, running: Hand) -> None:
    for which in ("500", "500.ply", "1000.obj", "final", "final.glb"):
        answer = client.get(url(running, which))
        problem(answer, 404, "result-not-ready")
        assert int(answer.headers["retry-after"]) >= 1
    problem(client.get(url(running, "501.ply")), 404, "not-found")


def test_nothing_is_ready_before_the_start(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted()
    for which in ("initial", "latest", "best", "final", "0.ply"):
        problem(client.get(url(hand, which)), 404, "result-not-ready")


def test_what_a_job_that_ended_early_did_not_reach_is_not_found(client: httpx.Client, running: Hand) -> None:
    running.end()
    problem(client.get(url(running, "500.ply")), 404, "not-found")
    assert client.get(url(running, "final")).json()["iteration"] == 100


def test_a_cancelled_job_without_a_result_has_no_final(client: httpx.Client, running: Hand) -> None:
    running.end(JobStatus.CANCELLED, result_iteration=None)
    problem(client.get(url(running, "final.ply")), 404, "not-found")
    assert client.get(url(running, "latest.ply")).status_code == 200


@pytest.mark.parametrize("which", ["-1", "01", "1e3", "last", "100.exe", "100.", "..%2f0", "%00", "9" * 40])
def test_what_is_no_snapshot_is_not_found(client: httpx.Client, running: Hand, which: str) -> None:
    problem(client.get(url(running, which)), 404, "not-found")


def test_the_time_series_as_json_and_csv(client: httpx.Client, running: Hand) -> None:
    running.reach(250, keep=False)
    answer = client.get(f"/v1/jobs/{running.job_id}/metrics")
    rows = answer.json()["rows"]
    assert [row["iteration"] for row in rows] == [0, 100, 250]
    table = client.get(f"/v1/jobs/{running.job_id}/metrics.csv")
    assert table.headers["content-type"] == "text/csv; charset=utf-8"
    assert table.headers["content-disposition"] == 'attachment; filename="bunny_metrics.csv"'
    read = list(csv.DictReader(io.StringIO(table.text)))
    assert [int(row["iteration"]) for row in read] == [0, 100, 250]
    assert [float(row["sphericity"]) for row in read] == [row["sphericity"] for row in rows]
    assert read[0]["volume"] == ""
    known = client.get(
        f"/v1/jobs/{running.job_id}/metrics", headers={"If-None-Match": answer.headers["etag"]}
    )
    assert known.status_code == 304


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_curl_saves_under_the_telling_name(base_url: str, running: Hand, tmp_path: Path) -> None:
    command = ["curl", "-sSfOJ", base_url + url(running, "latest.ply")]
    subprocess.run(command, cwd=tmp_path, timeout=30, check=True)
    assert [path.name for path in tmp_path.iterdir()] == ["bunny_it00100.ply"]


def test_a_state_comes_with_the_colours_of_a_field(client: httpx.Client, running: Hand) -> None:
    plain = client.get(url(running, "100.ply"))
    coloured = client.get(url(running, "100.ply"), params={"color": "quality"})
    assert b"comment colour quality (1) from " in coloured.content
    assert b"property uchar red" in coloured.content
    assert b"property uchar red" not in plain.content
    assert coloured.headers["etag"] != plain.headers["etag"]
    assert 'filename="bunny_it00100_quality.ply"' in coloured.headers["content-disposition"]
    by_type = client.get(url(running, "100"), params={"color": "quality"}, headers={"Accept": MEDIA["ply"]})
    assert by_type.content == coloured.content
    mesh = f"/v1/meshes/{running.job().spec.mesh_id}/content.obj"
    assert client.get(mesh, params={"color": "distance"}).text.startswith("# colour distance (1) from ")
    for params, name in (({"color": "beauty"}, "100.ply"), ({"color": "quality"}, "100.stl")):
        wrong = problem(client.get(url(running, name), params=params), 422, "invalid-parameters")
        assert wrong["errors"][0]["pointer"] == "query/color"
