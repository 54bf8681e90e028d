from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime

import httpx
import pytest

from service.schemas import percent
from spherify.jobs import layout
from spherify.jobs.model import JobError, JobStatus
from spherify.parameters import CurvatureParameters
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, OPEN, Hand, data_files, problem, stretched

Submit = Callable[..., Hand]


def test_one_form_uploads_and_submits(client: httpx.Client, stores: Stores) -> None:
    answer = client.post(
        "/v1/jobs",
        files={"file": ("bunny.obj", OCTAHEDRON)},
        data={"iterations": "5000", "snapshots": "100,500,1000", "tags": "animals, small"},
    )
    assert answer.status_code == 201
    job = answer.json()
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}" == job["links"]["self"]
    assert int(answer.headers["retry-after"]) >= 1
    assert (job["name"], job["tags"], job["preset"]) == ("bunny", ["animals", "small"], "robust")
    assert (job["status"], job["done"], job["attempt"]) == ("accepted", False, 0)
    assert job["snapshots"] == {"requested": [0, 100, 500, 1000, 5000], "available": []}
    assert job["parameters"]["iterations"] == 5000
    assert set(job["parameters"]) == set(CurvatureParameters.model_fields)
    assert job["progress"]["percent"] == 0
    assert job["queue"] == {"position": 0}
    assert job["started_at"] is job["finished_at"] is job["error"] is job["metrics"] is None
    assert client.get(job["links"]["self"]).json() == job
    assert client.get(job["links"]["mesh"]).json()["name"] == "bunny.obj"
    assert stores.queue.pending() == [job["id"]]
    assert stores.blobs.stat(layout.spec(job["id"])) is not None


def test_json_names_a_mesh_that_is_known(client: httpx.Client, known: str) -> None:
    request = {
        "mesh_id": known,
        "preset": "paper",
        "parameters": {"step": 0.01, "annealing": {"patience": 5, "factor": 0.5, "min_step": 1e-3}},
        "iterations": 40,
        "snapshots": [10, 20],
        "name": " второй ",
        "tags": ["a", "b", "a"],
    }
    job = client.post("/v1/jobs", json=request).json()
    assert (job["preset"], job["name"], job["tags"]) == ("paper", "второй", ["a", "b"])
    assert job["parameters"]["step"] == 0.01
    assert job["parameters"]["annealing"]["patience"] == 5
    assert job["parameters"]["schedule"][1] == {"repeat": 100, "k_in": 2, "k_out": 1}
    assert job["snapshots"]["requested"] == [0, 10, 20, 40]


def test_every_parameter_may_be_a_field_of_its_own(client: httpx.Client, known: str) -> None:
    fields = {
        "mesh_id": known,
        "parameters": '{"momentum": 0.5}',
        "measure": "dual-area",
        "window": "[10, 90]",
        "annealing": "null",
        "schedule": '[{"repeat": 2, "k_in": 1, "k_out": 1}]',
        "step": "0.02",
        "snapshots": "every:1000",
        "name": "123",
    }
    answer = client.post("/v1/jobs", files={name: (None, value) for name, value in fields.items()})
    assert answer.status_code == 201, answer.text
    parameters = answer.json()["parameters"]
    assert parameters["momentum"] == 0.5
    assert parameters["measure"] == "dual-area"
    assert parameters["window"] == [10, 90]
    assert parameters["annealing"] is None
    assert parameters["schedule"] == [{"repeat": 2, "k_in": 1, "k_out": 1}]
    assert parameters["step"] == 0.02
    assert answer.json()["name"] == "123"
    assert answer.json()["snapshots"]["requested"] == [0, 1000, 2000, 3000, 4000, 5000]


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"iterations": -1}, "#/iterations"),
        ({"iterations": 10**30}, "#/parameters/iterations"),
        ({"iterations": 2_000_000}, "#/parameters/iterations"),
        ({"iterations": "100"}, "#/iterations"),
        ({"iterations": 1.5}, "#/iterations"),
        ({"iterations": True}, "#/iterations"),
        ({"preset": "round"}, "#/preset"),
        ({"preset": 7}, "#/preset"),
        ({"parameters": {"step": 0}}, "#/parameters/step"),
        ({"parameters": {"step": float("nan")}}, "#/parameters/step"),
        ({"parameters": {"step": float("inf")}}, "#/parameters/step"),
        ({"parameters": {"window": [70, 30]}}, "#/parameters"),
        ({"parameters": {"steps": 1}}, "#/parameters/steps"),
        ({"parameters": {"a/b~c": 1}}, "#/parameters/a~1b~0c"),
        ({"parameters": []}, "#/parameters"),
        ({"parameters": {"schedule": [{"repeat": 1, "k_in": 0, "k_out": 0}]}}, "#/parameters"),
        ({"iterations": 5, "parameters": {"iterations": 6}}, "#/iterations"),
        ({"snapshots": "sometimes"}, "#/snapshots"),
        ({"snapshots": [99_999]}, "#/snapshots"),
        ({"name": "a\r\nSet-Cookie: b"}, "#/name"),
        ({"name": ""}, "#/name"),
        ({"name": " \u00a0 "}, "#/name"),
        ({"name": "x" * 121}, "#/name"),
        ({"tags": ["two words"]}, "#/tags/0"),
        ({"file": "x"}, "#/file"),
        ({"mesh_id": "mesh_" + "0" * 26}, "#/mesh_id"),
        ({"mesh_id": "../../etc"}, "#/mesh_id"),
        ({"mesh_id": None}, "#/mesh_id"),
    ],
)
def test_wrong_values_are_named(
    client: httpx.Client, known: str, change: dict[str, object], pointer: str
) -> None:
    text = json.dumps({"mesh_id": known} | change)
    answer = client.post("/v1/jobs", content=text, headers={"Content-Type": "application/json"})
    document = problem(answer, 422, "invalid-parameters")
    errors = document["errors"]
    assert isinstance(errors, list)
    assert errors[0]["pointer"].startswith(pointer)
    assert client.get("/v1/jobs").json()["items"] == []


@pytest.mark.parametrize(
    ("fields", "pointer"),
    [
        ({"step": "fast"}, "form/step"),
        ({"iterations": "many"}, "form/iterations"),
        ({"iterations": "9" * 5000}, "form/iterations"),
        ({"parameters": "[1]"}, "form/parameters"),
        ({"parameters": "{", "step": "1"}, "form/parameters"),
        ({"parameters": '{"step": 1}', "step": "2"}, "form/step"),
        ({"speed": "1"}, "form/speed"),
        ({"allow": "everything"}, "form/allow"),
        ({"mesh_id": "mesh_" + "0" * 26}, "form/file"),
        ({"name": "a\x00b"}, "form/name"),
        ({"momentum": "NaN"}, "form/momentum"),
        ({"snapshots": "every:0"}, "form/snapshots"),
        ({"preset": "round"}, "form/preset"),
        ({"iterations": "2000000"}, "form/iterations"),
        ({"step": "-1"}, "form/step"),
        ({"parameters": '{"step": -1}'}, "form/parameters/step"),
    ],
)
def test_wrong_form_fields_are_named(
    client: httpx.Client, stores: Stores, fields: dict[str, str], pointer: str
) -> None:
    answer = client.post("/v1/jobs", files={"file": ("o.obj", OCTAHEDRON)}, data=fields)
    document = problem(answer, 422, "invalid-parameters")
    errors = document["errors"]
    assert isinstance(errors, list)
    assert errors[0]["pointer"] == pointer
    assert data_files(stores.blobs.root) == set(), "nothing is read or kept before the values are checked"


@pytest.mark.parametrize(
    "request_body",
    [
        {"mesh_id": "x" * 900_000},
        {"mesh_id": "x", "y" * 900_000: 1},
        {"mesh_id": "x", **{f"member{n}": 1 for n in range(20_000)}},
        {"mesh_id": "x", "tags": ["two words"] * 20_000},
    ],
)
def test_a_large_wrong_request_gets_a_small_answer(
    client: httpx.Client, request_body: dict[str, object]
) -> None:
    answer = client.post("/v1/jobs", json=request_body)
    problem(answer, 422, "invalid-parameters")
    assert len(answer.content) < 30_000


@pytest.mark.parametrize(("sent", "name"), [('a"b.obj', "a_b"), ("a%41\n.obj", "a_41_"), ("два.obj", "два")])
def test_a_job_is_called_like_the_file_and_not_like_its_name_in_a_form(
    client: httpx.Client, known: str, sent: str, name: str
) -> None:
    """Whoever builds a form writes a quotation mark as %22, and so on."""
    answer = client.post("/v1/jobs", files={"file": (sent, OCTAHEDRON)})
    assert answer.json()["name"] == name


def test_a_misspelt_name_is_told_where_the_right_ones_are(client: httpx.Client, known: str) -> None:
    answer = client.post("/v1/jobs", json={"mesh_id": known, "parameters": {"steps": 1}})
    document = problem(answer, 422, "invalid-parameters")
    assert document["detail"] == "#/parameters/steps: unknown; /docs and /v1/parameters list the names"


def test_a_field_sent_twice_is_refused(client: httpx.Client) -> None:
    answer = client.post("/v1/jobs", files={"file": ("o.obj", OCTAHEDRON)}, data={"step": ["1", "2"]})
    problem(answer, 422, "invalid-parameters")


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"mesh_id": "\\ud800"}', "\xff", '{"a":NaN'])
def test_what_is_no_json_is_said_so(client: httpx.Client, text: str) -> None:
    headers = {"Content-Type": "application/json"}
    answer = client.post("/v1/jobs", content=text.encode("latin-1"), headers=headers)
    problem(answer, 400, "malformed-json")


def test_a_refused_mesh_makes_no_job(client: httpx.Client, stores: Stores) -> None:
    answer = client.post("/v1/jobs", files={"file": ("open.obj", OPEN)})
    problem(answer, 422, "mesh-not-closed")
    assert client.get("/v1/jobs").json()["items"] == []
    assert stores.queue.pending() == []
    assert (
        client.post("/v1/jobs", files={"file": ("open.obj", OPEN)}, data={"allow": "boundary"}).status_code
        == 201
    )


def test_progress_is_shown_as_it_is(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim()
    url = f"/v1/jobs/{hand.job_id}"
    running = client.get(url).json()
    assert (running["status"], running["attempt"]) == ("running", 1)
    assert running["started_at"] is not None
    hand.reach(0).reach(433, keep=False)
    job = client.get(url).json()
    assert job["progress"] == {
        "percent": 43.3,
        "iteration": 433,
        "iterations_total": 1000,
        "iterations_per_s": 50.0,
        "eta_s": 12.5,
        "elapsed_s": 8.66,
    }
    assert job["metrics"]["sphericity"] == pytest.approx(0.900433)
    assert job["snapshots"]["available"] == [0]
    hand.reach(1000)
    assert client.get(url).json()["progress"]["percent"] == 99.9, (
        "100 is never shown before the end is durable"
    )
    hand.end()
    job = client.get(url).json()
    assert (job["progress"]["percent"], job["status"], job["done"]) == (100, "successful", True)
    assert (job["stop_reason"], job["result_iteration"]) == ("iterations", 1000)
    times = [datetime.fromisoformat(job[f"{what}_at"]) for what in ("created", "started", "finished")]
    assert times == sorted(times)  # as text a whole second would come after its own parts
    assert "cancel" not in job["links"]
    assert client.get(job["links"]["final"]).json()["iteration"] == 1000


def test_percent_freezes_where_a_job_failed(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0).reach(250)
    hand.end(JobStatus.FAILED, stop_reason="collapsed", error=JobError("collapsed", "inside out at 251"))
    job = client.get(f"/v1/jobs/{hand.job_id}").json()
    assert (job["status"], job["progress"]["percent"]) == ("failed", 25.0)
    assert job["error"] == {"code": "collapsed", "detail": "inside out at 251"}
    assert job["progress"]["eta_s"] is None


def test_percent_of_no_iterations(submitted: Submit) -> None:
    hand = submitted(iterations="0", snapshots="0").claim().reach(0)
    assert percent(hand.job()) == 0
    assert percent(hand.end().job()) == 100


def test_an_unchanged_job_is_not_sent_again(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim()
    first = client.get(f"/v1/jobs/{hand.job_id}")
    assert first.headers["retry-after"]
    known = {"If-None-Match": first.headers["etag"]}
    second = client.get(f"/v1/jobs/{hand.job_id}", headers=known)
    assert (second.status_code, second.content) == (304, b"")
    assert second.headers["etag"] == first.headers["etag"]
    hand.reach(1)
    third = client.get(f"/v1/jobs/{hand.job_id}", headers=known)
    assert third.status_code == 200
    hand.end()
    assert "retry-after" not in client.get(f"/v1/jobs/{hand.job_id}").headers


def test_a_place_in_the_queue_is_part_of_the_tag(client: httpx.Client, submitted: Submit) -> None:
    ahead, behind = submitted(), submitted()
    first = client.get(f"/v1/jobs/{behind.job_id}")
    assert first.json()["queue"]["position"] == 1
    ahead.claim()
    again = client.get(f"/v1/jobs/{behind.job_id}", headers={"If-None-Match": first.headers["etag"]})
    assert again.json()["queue"]["position"] == 0


def test_jobs_are_found_by_state_tag_mesh_and_time(client: httpx.Client, submitted: Submit) -> None:
    first = submitted(tags="red")
    second = submitted(tags="red,blue").claim()
    other = client.put("/v1/meshes?name=other.obj", content=stretched(2)).json()["id"]
    third = submitted(mesh_id=other, tags="blue")

    def found(**query: str | int) -> list[str]:
        answer = client.get("/v1/jobs", params=query)
        assert answer.status_code == 200, answer.text
        return [job["id"] for job in answer.json()["items"]]

    assert found() == [third.job_id, second.job_id, first.job_id]
    assert found(status="running") == [second.job_id]
    assert found(tag="red") == [second.job_id, first.job_id]
    assert found(tag="blue", status="accepted") == [third.job_id]
    assert found(mesh_id=other) == [third.job_id]
    created = client.get(f"/v1/jobs/{second.job_id}").json()["created_at"]
    assert found(created_after=created) == [third.job_id]
    assert found(created_after="2999-01-01T00:00:00Z") == []
    first_page = client.get("/v1/jobs", params={"limit": 1, "tag": "red"})
    assert client.get(first_page.links["next"]["url"]).json()["items"][0]["id"] == first.job_id


@pytest.mark.parametrize(
    "query",
    [
        "limit=0",
        "limit=201",
        "limit=x",
        "status=done",
        "created_after=soon",
        "cursor=%00",
        "cursor=",
        "tag=%0a",
    ],
)
def test_wrong_filters_are_named(client: httpx.Client, query: str) -> None:
    document = problem(client.get(f"/v1/jobs?{query}"), 422, "invalid-parameters")
    errors = document["errors"]
    assert isinstance(errors, list)
    assert errors[0]["pointer"] == f"query/{query.split('=', maxsplit=1)[0]}"


@pytest.mark.parametrize(
    "time", ["0001-01-01T00:00:00+14:00", "1969-12-31T23:59:59Z", "1970-01-01T00:00:00Z"]
)
def test_every_job_was_made_after_a_time_long_ago(client: httpx.Client, submitted: Submit, time: str) -> None:
    job_id = submitted().job_id
    answer = client.get("/v1/jobs", params={"created_after": time})
    assert [job["id"] for job in answer.json()["items"]] == [job_id]


def test_a_waiting_job_is_cancelled_at_once_and_again(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted()
    for _ in range(2):
        answer = client.post(f"/v1/jobs/{hand.job_id}/cancel")
        assert answer.status_code == 200
        assert answer.json()["status"] == "cancelled"


def test_a_running_job_is_told(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0)
    answer = client.post(f"/v1/jobs/{hand.job_id}/cancel")
    assert answer.status_code == 202
    assert answer.json()["status"] == "cancelling"
    assert answer.headers["retry-after"]
    assert client.post(f"/v1/jobs/{hand.job_id}/cancel").status_code == 202
    hand.end(JobStatus.CANCELLED, stop_reason="cancelled")
    assert client.get(f"/v1/jobs/{hand.job_id}/snapshots/latest.obj").status_code == 200


def test_a_finished_job_cannot_be_cancelled(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0).end()
    problem(client.post(f"/v1/jobs/{hand.job_id}/cancel"), 409, "job-already-finished")


def test_only_finished_jobs_are_deleted_and_stay_gone(
    client: httpx.Client, submitted: Submit, stores: Stores
) -> None:
    hand = submitted().claim().reach(0)
    url = f"/v1/jobs/{hand.job_id}"
    problem(client.delete(url), 409, "job-not-finished")
    hand.end()
    answer = client.delete(url)
    assert (answer.status_code, answer.content) == (204, b"")
    for path in ("", "/snapshots", "/snapshots/latest", "/snapshots/0.ply", "/metrics", "/metrics.csv"):
        problem(client.get(url + path), 410, "gone")
    problem(client.delete(url), 410, "gone")
    problem(client.post(f"{url}/cancel"), 410, "gone")
    assert not list(stores.blobs.list(layout.job_folder(hand.job_id)))


@pytest.mark.parametrize(
    "name", ["job_" + "0" * 26, "job_x", "..%2f..%2fetc", "job_%00", "%F0%9F%90%87", "x" * 3000]
)
@pytest.mark.parametrize(
    "rest", ["", "/snapshots", "/snapshots/0", "/snapshots/0.obj", "/metrics", "/metrics.csv"]
)
def test_unknown_jobs_are_not_found(client: httpx.Client, name: str, rest: str) -> None:
    problem(client.get(f"/v1/jobs/{name}{rest}"), 404, "not-found")
