"""Pages for people, complete in themselves: no other host, no script."""

from __future__ import annotations

import html
import json
import re
from typing import Any, Final

from service.problem_types import PROBLEMS, ProblemType
from spherify import __version__

_STYLE: Final = """
:root { color-scheme: light dark; --line: #8884; --soft: #8882; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.5rem; }
pre { background: var(--soft); padding: .7rem 1rem; overflow-x: auto; border-radius: .4rem; }
code { font-family: ui-monospace, monospace; font-size: .9em; }
table { border-collapse: collapse; width: 100%; } td, th { text-align: left; vertical-align: top; padding: .3rem .6rem;
border-top: 1px solid var(--line); } details { margin: .6rem 0; border: 1px solid var(--line); border-radius: .4rem;
padding: .4rem .8rem; } summary { cursor: pointer; } summary code { font-weight: 600; }
"""


def page(title: str, body: str) -> str:
    """Return a whole page; `body` is HTML already."""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{_STYLE}</style></head><body>{body}</body></html>\n"
    )


def landing(base_url: str, told: str) -> str:
    """Return the page at `/` of a service whose web page is not built; `told` says so."""
    base = html.escape(base_url.rstrip("/"))
    return page(
        "Spherify",
        f"""<h1>Spherify</h1>
<p><strong>{_prose(told)}</strong></p>
<p>A service that morphs closed triangle meshes into round spheres by Vartziotis's curvature transformation
(<a href="https://arxiv.org/abs/1608.03898">arXiv:1608.03898</a>). Version {__version__}.</p>
<p>Send a mesh; the answer is a job, and its <code>id</code> goes in the place of <code>$JOB</code>:</p>
<pre># morph bunny.obj, and keep three states on the way
curl -F file=@bunny.obj -F snapshots=10,50,100 {base}/v1/jobs
# how far it is
curl {base}/v1/jobs/$JOB
# the mesh as it is now; final.ply when it is done
curl -OJ {base}/v1/jobs/$JOB/snapshots/latest.ply</pre>
<ul><li><a href="/docs">Documentation of every address</a> (<a href="/openapi.json">OpenAPI</a>)</li>
<li><a href="/problems">Every problem the service answers with</a></li>
<li><a href="/v1/jobs">Jobs</a>, <a href="/v1/meshes">meshes</a>, <a href="/v1/presets">presets</a>,
<a href="/v1/parameters">parameters</a>, <a href="/v1/info">limits</a>, <a href="/readyz">state</a></li></ul>""",
    )


def problem_index() -> str:
    """Return the page at `/problems`."""
    rows = "".join(
        f'<tr><td><a href="{problem.uri}"><code>{problem.slug}</code></a></td><td>{problem.status}</td>'
        f"<td>{html.escape(problem.title)}</td></tr>"
        for problem in PROBLEMS.values()
    )
    return page(
        "Problems",
        "<h1>Problems</h1><p>Everything that goes wrong is answered with <code>application/problem+json</code> "
        "(<a href='https://www.rfc-editor.org/rfc/rfc9457'>RFC 9457</a>): <code>type</code>, <code>title</code>, "
        "<code>status</code>, <code>detail</code>, <code>instance</code>, <code>request_id</code> and "
        f"<code>errors</code>.</p><table><tr><th>type<th>status<th>title</tr>{rows}</table>",
    )


def problem_page(problem: ProblemType) -> str:
    """Return the page that a problem's `type` leads to."""
    retry = (
        f"<p>It carries <code>Retry-After: {problem.retry_after_s}</code> or another number of seconds.</p>"
        if problem.retry_after_s is not None
        else ""
    )
    return page(
        problem.title,
        f"<h1>{html.escape(problem.title)}</h1><p><code>{problem.slug}</code>, status {problem.status}</p>"
        f"<p>{_prose(problem.cure)}</p>{retry}<p><a href='/problems'>All problems</a></p>",
    )


def documentation(openapi: dict[str, Any]) -> str:
    """Return the page at `/docs`, made from the OpenAPI document."""
    parts = [f"<h1>{html.escape(openapi['info']['title'])}</h1>", _paragraphs(openapi["info"]["description"])]
    for tag in openapi["tags"]:
        parts.append(f"<h2>{html.escape(tag['name'])}</h2>{_paragraphs(tag['description'])}")
        parts += [
            _operation(method, path, operation)
            for path, methods in openapi["paths"].items()
            for method, operation in methods.items()
            if tag["name"] == operation["tags"][-1]
        ]
    schemas = openapi["components"]["schemas"]
    parts.append("<h2>Schemas</h2>")
    parts += [
        f"<details id='{html.escape(name)}'><summary><code>{html.escape(name)}</code> "
        f"{_prose(schema.get('description', ''))}</summary>{_properties(schema)}</details>"
        for name, schema in schemas.items()
    ]
    return page(openapi["info"]["title"], "".join(parts))


def _operation(method: str, path: str, operation: dict[str, Any]) -> str:
    rows = "".join(
        f"<tr><td><code>{html.escape(p['name'])}</code> ({p['in']})<td>{_value(p['schema'])}"
        f"<td>{_prose(p.get('description', ''))}</tr>"
        for p in operation.get("parameters", ())
    )
    parameters = f"<h4>Parameters</h4><table>{rows}</table>" if rows else ""
    bodies = "".join(
        f"<h4>Body: {html.escape(kind)}</h4>{_properties(content['schema'])}"
        for kind, content in operation.get("requestBody", {}).get("content", {}).items()
    )
    answers = "".join(
        f"<tr><td>{status}<td>{_prose(answer['description'])}<td>{_kinds(answer)}</tr>"
        for status, answer in sorted(operation["responses"].items())
    )
    return (
        f"<details id='{operation['operationId']}'><summary><code>{method.upper()} {html.escape(path)}</code> "
        f"{html.escape(operation['summary'])}</summary>{_paragraphs(operation.get('description', ''))}"
        f"{parameters}{bodies}<h4>Answers</h4><table>{answers}</table></details>"
    )


def _kinds(answer: dict[str, Any]) -> str:
    return "<br>".join(
        f"{html.escape(kind)} {_type(content.get('schema', {})) if '$ref' in content.get('schema', {}) else ''}"
        for kind, content in answer.get("content", {}).items()
    )


def _properties(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        return f"<p>{_type(schema)}</p>"
    rows = "".join(
        f"<tr><td><code>{html.escape(name)}</code><td>{_value(inner)}<td>{_prose(inner.get('description', ''))}</tr>"
        for name, inner in schema.get("properties", {}).items()
    )
    return f"<table>{rows}</table>" if rows else f"<p>{_type(schema)}</p>"


def _value(schema: dict[str, Any]) -> str:
    """Return what a value may be, and what it is when none is given."""
    default = schema.get("default")
    told = "" if default is None else f"<br>by default <code>{html.escape(json.dumps(default))}</code>"
    return _type(schema) + told


def _type(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        name = html.escape(schema["$ref"].rsplit("/", 1)[-1])
        return f"<a href='#{name}'>{name}</a>"
    if "enum" in schema:
        return " · ".join(f"<code>{html.escape(json.dumps(value))}</code>" for value in schema["enum"])
    for join in ("anyOf", "oneOf"):
        if join in schema and "type" not in schema:
            return " or ".join(map(_type, schema[join]))
    if schema.get("type") == "array" and isinstance(schema.get("items"), dict):
        return f"list of {_type(schema['items'])}"
    bounds = {"minimum": "≥", "exclusiveMinimum": "&gt;", "maximum": "≤", "exclusiveMaximum": "&lt;"}
    limits = [f"{sign} {schema[name]:g}" for name, sign in bounds.items() if name in schema]
    return html.escape(str(schema.get("format", schema.get("type", "anything")))) + (
        f" ({', '.join(limits)})" if limits else ""
    )


def _paragraphs(text: str) -> str:
    return "".join(f"<p>{_prose(part)}</p>" for part in text.split("\n\n") if part.strip())


def _prose(text: str) -> str:
    """Escape, and set what stands in backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))
