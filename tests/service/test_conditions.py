"""If-Match and If-None-Match: nothing is done to what is not as the client takes it to be."""

from __future__ import annotations

from collections.abc import Callable

import httpx
import pytest

from spherify.stores.connect import Stores
from tests.service.conftest import Hand, problem, stretched

Submit = Callable[..., Hand]


@pytest.fixture(params=["job", "mesh"])
def path(request: pytest.FixtureRequest, client: httpx.Client) -> str:
    """Something that can be deleted."""
    if request.param == "job":
        submit: Submit = request.getfixturevalue("submitted")
        return f"/v1/jobs/{submit().claim().reach(0).end().job_id}"
    return str(client.put("/v1/meshes?name=o.obj", content=stretched(3.25)).headers["location"])


def test_only_what_is_as_it_was_is_deleted(client: httpx.Client, path: str) -> None:
    etag = client.get(path).headers["etag"]
    wrong = [("If-Match", value) for value in ('"nope"', f"W/{etag}", "nope", "")]
    wrong += [("If-None-Match", value) for value in ("*", etag, f"W/{etag}", f'"nope", {etag}')]
    for name, value in wrong:
        answer = client.delete(path, headers={name: value})
        assert etag in str(problem(answer, 412, "precondition-failed")["detail"]), (name, value)
    assert client.get(path).status_code == 200
    both = {"If-Match": f'"nope", {etag}', "If-None-Match": '"nope"'}
    assert client.delete(path, headers=both).status_code == 204
    assert client.delete(path, headers={"If-Match": "*"}).status_code in {404, 410}


def test_whatever_there_is_may_be_deleted(client: httpx.Client, path: str) -> None:
    assert client.delete(path, headers={"If-Match": "*"}).status_code == 204


def test_what_is_refused_anyway_is_refused_as_ever(
    client: httpx.Client, submitted: Submit, known: str
) -> None:
    """RFC 9110, 13.2.1: conditions come last."""
    path = f"/v1/jobs/{submitted().job_id}"
    problem(client.delete(path, headers={"If-Match": '"nope"'}), 409, "job-not-finished")
    nothing = f"/v1/jobs/job_{'0' * 26}"
    problem(client.delete(nothing, headers={"If-Match": '"nope"'}), 404, "not-found")


def test_what_is_looked_at_may_have_to_be_as_it_was(
    client: httpx.Client, stores: Stores, submitted: Submit
) -> None:
    job = f"/v1/jobs/{submitted().claim().reach(0).end().job_id}"
    for path in (job, f"{job}?wait=0", f"{job}/snapshots/0.ply", f"{job}/snapshots"):
        etag = client.get(path).headers["etag"]
        for method in ("GET", "HEAD"):
            assert client.request(method, path, headers={"If-Match": etag}).status_code == 200
            assert client.request(method, path, headers={"If-Match": '"nope"'}).status_code == 412
        problem(client.get(path, headers={"If-Match": '"nope"'}), 412, "precondition-failed")
        both = {"If-Match": etag, "If-None-Match": etag}
        assert client.get(path, headers=both).status_code == 304


def test_a_tag_is_found_on_any_line_of_a_header(client: httpx.Client, path: str) -> None:
    etag = client.get(path).headers["etag"]
    lines = [("If-None-Match", '"nope"'), ("If-None-Match", etag)]
    assert client.get(path, headers=lines).status_code == 304
