"""Checks templates: they compile, escape, contain nothing inline, and every address in them leads to a route or
a file.
"""

import ast
import importlib
from functools import cache

import jinja2
import pytest
from fastapi import APIRouter, FastAPI
from starlette.routing import Match

from tests.architecture.markup import HOLE, Address, forbidden, requests, static_files, template_texts, uncommented
from tests.architecture.sources import ROOT, modules


def environment() -> jinja2.Environment:
    """The console's own template environment."""
    found = importlib.import_module("app.web.rendering").TEMPLATES
    assert isinstance(found, jinja2.Environment)
    return found


@cache
def console_routes() -> FastAPI:
    """All routers of app/routes, under the prefixes that app/main.py gives them."""
    app = FastAPI()
    prefixes = included_prefixes((ROOT / "app" / "main.py").read_text(encoding="utf-8"))
    for source in modules("app/routes"):
        router = getattr(importlib.import_module(source.name), "router", None)
        if isinstance(router, APIRouter):
            app.include_router(router, prefix=prefixes.get(source.name.rpartition(".")[2], ""))
    return app


def included_prefixes(text: str) -> dict[str, str]:
    """Module name -> prefix, from every `include_router(missions.router, prefix="/missions")`."""
    found = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("include_router") and node.args:
            name = ast.unparse(node.args[0]).removesuffix(".router").rpartition(".")[2]
            for keyword in node.keywords:
                if keyword.arg == "prefix" and isinstance(keyword.value, ast.Constant):
                    found[name] = str(keyword.value.value)
    return found


def paths(app: FastAPI) -> list[str]:
    """The paths of all routes, those of included routers too."""
    known = [
        inner for route in app.routes for inner in getattr(getattr(route, "original_router", None), "routes", [route])
    ]
    return [getattr(route, "path", "") for route in known]


def resolves(address: Address, app: FastAPI) -> bool:
    """Whether a route answers this method at this path; a hole may stand for a number or for a word of a route."""
    words = {segment for path in paths(app) for segment in path.split("/") if "{" not in segment}
    scopes = [
        {
            "type": "http",
            "method": address.method,
            "path": address.path.replace(HOLE, "1", holes).replace(HOLE, value),
            "headers": [],
        }
        for holes in range(address.path.count(HOLE) + 1)
        for value in ("word", *words)
    ]
    return any(route.matches(scope)[0] is Match.FULL for scope in scopes for route in app.routes)


def test_every_template_compiles_and_refuses_undefined_values() -> None:
    if not template_texts():
        return
    assert environment().undefined is jinja2.StrictUndefined
    assert environment().autoescape is not False
    for name in template_texts():
        environment().get_template(name)


def test_no_line_of_a_template_is_longer_than_120_columns() -> None:
    lines = [(name, place) for name, text in template_texts().items() for place in too_long(text)]
    assert lines == []
    assert too_long(f"<p>\n{'x' * 121}\n</p>") == [2]


def too_long(text: str) -> list[int]:
    """Numbers of the lines that are too long to review."""
    return [place for place, line in enumerate(text.split("\n"), 1) if len(line) > 120]


def test_nothing_is_inline_and_nothing_unescaped() -> None:
    assert [f"{name}: {what}" for name, text in template_texts().items() for what in forbidden(text)] == []


def test_every_request_of_a_template_resolves_to_a_route() -> None:
    addresses = {(name, address) for name, text in template_texts().items() for address in requests(text)}
    dead = [
        f"{name}: {address.method} {address.url.replace(HOLE, '{}')}"
        for name, address in sorted(addresses, key=str)
        if address.path and not resolves(address, console_routes())
    ]
    assert dead == []


def test_every_static_file_a_template_loads_is_there() -> None:
    loaded = {(name, path) for name, text in template_texts().items() for path in static_files(text)}
    assert [f"{name}: {path}" for name, path in sorted(loaded) if not (ROOT / path.lstrip("/")).is_file()] == []


def test_every_page_has_a_title_and_one_language() -> None:
    for name, text in template_texts().items():
        if "<html" in text:
            assert "<title>" in text, name
            assert "<html lang=" in text, name


@pytest.mark.parametrize(
    "text",
    [
        "<script>go()</script>",
        "<p style='color:red'>",
        "<style>p{}</style>",
        "<a onclick='go()'>",
        "<a hx-on:click='go()'>",
        "<a href='javascript:go()'>",
        "{{ name | safe }}",
        "{% autoescape false %}",
    ],
)
def test_inline_and_unescaped_things_are_found(text: str) -> None:
    assert list(forbidden(text))


def test_a_script_from_a_file_and_an_expression_with_angles_are_free() -> None:
    text = """<script src="/static/js/live.js" defer></script> {{ "on" if a > b else "off" }} <p data-style="x">"""
    assert list(forbidden(text)) == []


def test_addresses_are_read_from_htmx_and_forms() -> None:
    text = """<section hx-get="/missions/{{ page["id"] }}/timeline"> {# <p hx-get="/gone"> #}
    <form method="post" action="/missions/{{ page.id }}/stop"><button formaction="/x?y=1" formmethod="get">"""
    assert list(requests(uncommented(text))) == [
        Address("GET", f"/missions/{HOLE}/timeline"),
        Address("POST", f"/missions/{HOLE}/stop"),
        Address("GET", "/x?y=1"),
    ]


def test_static_files_are_read_from_addresses_and_assets() -> None:
    text = """<link href="{{ asset('css/base.css') }}"><script src="/static/js/live.js?v=1"></script><a href="/x">"""
    assert list(static_files(text)) == ["/static/css/base.css", "/static/js/live.js"]


def test_an_address_without_a_route_or_with_another_method_is_found() -> None:
    router = APIRouter()
    router.add_api_route("/{mission_id}/stop", lambda mission_id: mission_id, methods=["POST"])
    app = FastAPI()
    app.include_router(router, prefix=included_prefixes("app.include_router(missions.router, prefix='/m')")["missions"])
    assert resolves(Address("POST", f"/m/{HOLE}/stop?now=1"), app)
    assert not resolves(Address("GET", f"/m/{HOLE}/stop"), app)
    assert not resolves(Address("POST", f"/m/{HOLE}/stops"), app)
