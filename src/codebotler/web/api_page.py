"""The page about the API, made from its OpenAPI description."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Any

from fastapi import FastAPI
from fastapi.responses import HTMLResponse

PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>CodeBotler: the API</title>
<link rel="stylesheet" href="/static/api.css"></head><body><main><h1>The API</h1>
<p>Everything the page does. Send the token with each request: <code>Authorization: Bearer TOKEN</code>.
For machines: <a href="/api/openapi.json">openapi.json</a>. <a href="/">Back to the page</a></p>
{calls}</main></body></html>"""


def add(app: FastAPI) -> None:
    """Add the page /api."""

    @app.get("/api", include_in_schema=False)
    def page() -> HTMLResponse:
        return HTMLResponse(PAGE.format(calls="".join(_calls(app.openapi()))))


def _calls(about: dict[str, Any]) -> Iterator[str]:
    for path, methods in about["paths"].items():
        for method, call in methods.items():
            yield f"<section><h2><b>{method.upper()}</b> {escape(path)}</h2>"
            yield f"<p>{escape(call.get('description', ''))}</p>"
            yield f"{_queries(call)}{_body(call, about)}</section>"


def _queries(call: dict[str, Any]) -> str:
    rows = [
        f"<li><code>?{escape(one['name'])}=</code> {escape(one['description'])}</li>"
        for one in call.get("parameters", ())
        if one["in"] == "query" and "description" in one
    ]
    return f"<ul>{''.join(rows)}</ul>" if rows else ""


def _body(call: dict[str, Any], about: dict[str, Any]) -> str:
    content = call.get("requestBody", {}).get("content", {}).get("application/json")
    if content is None:
        return ""
    form = about["components"]["schemas"][content["schema"]["$ref"].rpartition("/")[2]]
    needed = form.get("required", ())
    rows = [
        f"<li><code>{escape(name)}</code> {escape(field['type'])}{'' if name in needed else ', optional'}"
        f" {escape(field.get('description', ''))}</li>"
        for name, field in form["properties"].items()
    ]
    return f"<ul>{''.join(rows)}</ul>"
