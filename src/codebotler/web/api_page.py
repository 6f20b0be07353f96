"""The page about the API, made from its OpenAPI description, with a command to try for each address."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from html import escape
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse

from codebotler.web.frame import BAR, HEAD, Frame
from codebotler.web.proxy import prefix_of

PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>API · {brand}</title>
{head}<link rel="stylesheet" href="{prefix}/static/api.css"></head><body>
<header class="{bar}"><a class="brand" href="{prefix}/">{brand}</a>
<nav class="pages" aria-label="Pages">{links}</nav></header>
<main class="api"><h1>The API</h1>
<p>The API does everything that the page does. Each request must send the token: set <code>TOKEN</code> to
the text after <code>token=</code> in the link that was printed when the server started, and paste the
commands below into a terminal. The machine-readable description is
<a href="{prefix}/api/openapi.json">openapi.json</a>.</p>
{calls}</main>{stop}</body></html>"""

EXAMPLES: dict[str, object] = {
    "instruction": "Check every printer room for a stapler, and come back and tell me which have none.",
    "program": 'def task_program():\n    say("Hello")\n',
}
"""What a field may hold, where its description has no example."""

PLACE, PLACES = re.compile(r"\{(\w+)\}"), {"mission": "current", "prompt": "0", "index": "0"}
"""What an address has in braces, and what may stand there; for the rest, its name in capitals."""

NEEDLESS = frozenset({"model", "despite_problems"})
"""Fields that an example leaves out."""


def add(app: FastAPI, frame: Frame) -> None:
    """Add the page /api."""

    @app.get("/api", include_in_schema=False)
    def page(request: Request) -> HTMLResponse:
        prefix = prefix_of(request.scope)
        links = "".join(f'<a href="{prefix}{address}">{escape(name)}</a>' for name, address in frame.links)
        calls = "".join(_calls(app.openapi(), str(request.base_url).rstrip("/")))
        bar, stop = ("bar", BAR) if frame.has_robot else ("bar no-stop", "")
        head, stop = (part.format(prefix=prefix) for part in (HEAD, stop))
        parts = {"brand": frame.brand, "head": head, "bar": bar, "links": links, "calls": calls, "stop": stop}
        return HTMLResponse(PAGE.format(prefix=prefix, **parts))


def _calls(about: dict[str, Any], site: str) -> Iterator[str]:
    for path, methods in about["paths"].items():
        for method, call in methods.items():
            form = _form(call, about)
            yield f"<section><h2><b>{method.upper()}</b> {escape(path)}</h2>"
            yield f"<p>{escape(call.get('description', ''))}</p>{_queries(call)}{_fields(form)}"
            yield f'<pre tabindex="0">{escape(command(method, site + path, form))}</pre></section>'


def command(method: str, address: str, form: dict[str, Any] | None) -> str:
    """The call of an address in a shell."""
    parts = ["curl", "-H", '"Authorization: Bearer $TOKEN"']
    if method != "get":
        parts += ["-X", method.upper()]
    if form is not None:
        fields = form["properties"]
        chosen = [name for name in fields if name in form.get("required", ())] or [
            name for name in fields if name not in NEEDLESS
        ][:1]
        body = {name: _example(name, fields[name]) for name in chosen}
        parts += ["-H", "content-type:application/json", "-d", shlex.quote(json.dumps(body))]
    return " ".join(
        [*parts, shlex.quote(PLACE.sub(lambda place: PLACES.get(place[1], place[1].upper()), address))]
    )


def _example(name: str, field: dict[str, Any]) -> object:
    given = field.get("examples") or [
        EXAMPLES.get(name, {"boolean": True, "integer": 1}.get(field["type"], "…"))
    ]
    return given[0]


def _form(call: dict[str, Any], about: dict[str, Any]) -> dict[str, Any] | None:
    content = call.get("requestBody", {}).get("content", {}).get("application/json")
    if content is None:
        return None
    form: dict[str, Any] = about["components"]["schemas"][content["schema"]["$ref"].rpartition("/")[2]]
    return form


def _queries(call: dict[str, Any]) -> str:
    rows = [
        f"<li><code>?{escape(one['name'])}=</code> {escape(one['description'])}</li>"
        for one in call.get("parameters", ())
        if one["in"] == "query" and "description" in one
    ]
    return f"<ul>{''.join(rows)}</ul>" if rows else ""


def _fields(form: dict[str, Any] | None) -> str:
    if form is None:
        return ""
    needed = form.get("required", ())
    rows = [
        f"<li><code>{escape(name)}</code> {escape(field['type'])}{'' if name in needed else ', optional'}"
        f" {escape(field.get('description', ''))}</li>"
        for name, field in form["properties"].items()
    ]
    return f"<ul>{''.join(rows)}</ul>"
