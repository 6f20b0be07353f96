"""Each rule that keeps others from the robot is tried from outside, on the port."""

from __future__ import annotations

import asyncio
import http.client
import json
import re
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from socket import create_connection, gethostname
from urllib.parse import urlsplit

import pytest
from starlette.types import Message, Receive, Scope, Send
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from codebotler.core.errors import UserError
from codebotler.web.security.access import (
    MAX_WRONG_TOKENS,
    WRONG_TOKEN_SECONDS,
    Access,
    PageAddress,
    Role,
    TooManyTriesError,
    read_cookie_secret,
)
from codebotler.web.security.guard import MAX_AGENT_BODY_BYTES, MAX_BODY_BYTES, Guard, _is_same
from codebotler.web.security.proxy import OuterAddress, proxies_in_front
from codebotler.web.server import _address
from command_line import ENVIRONMENT
from forked import PAGE, Forked
from pageserver import PageServer

SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("page")) as server:
        yield server


def open_socket(server: PageServer, **headers: str) -> int:
    """Open a websocket like a browser, and return the status: 101 if it opens."""
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        with connect(
            f"ws://127.0.0.1:{server.port}{SOCKET}", additional_headers=given, proxy=None, open_timeout=30
        ):
            return 101
    except InvalidStatus as error:
        return error.response.status_code


def origin(server: PageServer) -> str:
    return f"http://127.0.0.1:{server.port}"


# --- tokens


def test_nothing_is_answered_without_the_token(server: PageServer) -> None:
    for path in ("/", "/missions", "/api", "/api/robot", "/api/openapi.json", "/static/page.css", "/nothing"):
        assert server.ask("GET", path).status == 401, path
    for method, path in (("POST", "/api/missions"), ("POST", "/api/stop"), ("POST", "/api/check")):
        assert server.ask(method, path, {}).status == 401, path
    assert open_socket(server, origin=origin(server)) == 403


def test_clients_that_send_no_whole_request_give_way_to_new_ones(server: PageServer) -> None:
    with ExitStack() as held:
        slow = [held.enter_context(create_connection(("127.0.0.1", server.port), 10)) for _ in range(102)]
        for each in slow[1:]:
            each.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n")
        assert slow[0].recv(1) == b""
        slow[-1].sendall(b"\r\n")
        assert slow[-1].recv(1_000).startswith(b"HTTP/1.1 401 ")


def test_the_link_opens_the_page_and_leaves_no_token_in_it(server: PageServer) -> None:
    answer = server.ask("GET", f"/missions?a=b&token={server.token}")
    path = server.path
    assert (answer.status, answer.headers["location"]) == (303, f"{path}/missions?a=b")
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"codebotler-{server.port}-operator-"), "pages of one machine share its cookies"
    assert path[1:9] in cookie.partition("=")[0], "a server on another port must not make one of this name"
    assert server.token not in cookie
    parts = {part.strip().lower() for part in cookie.split(";")}
    assert {"httponly", "samesite=strict", f"path={path}"} <= parts
    assert len(path) > 32, "a server on another port must not guess which path has the cookie"
    assert server.ask("GET", f"{path}/", cookie=cookie.partition(";")[0]).status == 200
    assert open_socket(server, cookie=cookie.partition(";")[0], origin=origin(server)) == 101


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("//example.org/", 404),
        ("/%09/example.org", 400),
        ("/%09//example.org", 400),
        ("/%5C/example.org", 404),
        ("/%5Cexample.org", 404),
        ("//%5Cexample.org", 404),
        ("/%2Fexample.org", 404),
        ("/nothing", 404),
        ("/%0d%0aX", 400),
        ("/%0d%0aX:%20y", 400),
        ("/a%00b", 400),
        ("/%7f", 400),
        ("/missions/a%0d%0ab", 400),
        ("/missions/..%2f..%2fetc", 404),
        ("/missions/%2e%2e", 404),
        ("/%C2%85", 400),
    ],
)
def test_the_link_leads_only_to_pages_of_ours(server: PageServer, path: str, status: int) -> None:
    answer = server.ask("GET", f"{path}?token={server.token}")
    assert (answer.status, "location" in answer.headers) == (status, False)


@pytest.mark.parametrize(
    ("path", "leads"),
    [("/", "/"), ("//missions/", "/missions"), ("/missions/a%20b%5Cc", "/missions/a%20b%5Cc")],
)
def test_the_link_of_a_page_opens_it(server: PageServer, path: str, leads: str) -> None:
    answer = server.ask("GET", f"{path}?token={server.token}")
    assert (answer.status, answer.headers["location"]) == (303, server.path + leads)


@pytest.mark.parametrize(
    ("path", "status"),
    [("/a%00b", 400), ("/static/a%00b", 400), ("/%0d%0aX", 400), ("/api/missions/a%00b", 404)],
)
def test_control_characters_are_allowed_only_in_names(server: PageServer, path: str, status: int) -> None:
    assert server.call("GET", path).status == status


def test_a_cookie_cannot_be_made_from_a_token() -> None:
    one, other = (Access.from_options("a token that a person chose") for _ in range(2))
    assert one.of_cookie(one.cookie(Role.OPERATOR)) is Role.OPERATOR
    assert other.of_cookie(one.cookie(Role.OPERATOR)) is None


def test_only_a_face_keeps_its_cookie_after_a_restart() -> None:
    """While the server is down, another program may take its port, and get the cookies of open pages."""
    before, after = (Access("o" * 20, "f" * 20, cookie_secret=b"kept") for _ in range(2))
    assert after.of_cookie(before.cookie(Role.FACE)) is Role.FACE
    assert after.of_cookie(before.cookie(Role.OPERATOR)) is None
    assert before.of_cookie(before.cookie(Role.OPERATOR)) is Role.OPERATOR


def test_the_secret_of_cookies_outlives_a_restart(tmp_path: Path) -> None:
    first = read_cookie_secret(tmp_path / "home")
    assert read_cookie_secret(tmp_path / "home") == first
    file = tmp_path / "home" / "cookie-secret"
    assert file.stat().st_mode & 0o777 == 0o600
    file.write_bytes(b"short")
    with pytest.raises(UserError):
        read_cookie_secret(tmp_path / "home")


def test_wrong_tokens_and_cookies_open_nothing(server: PageServer) -> None:
    assert server.ask("GET", "/?token=wrong").status == 401
    assert server.ask("GET", "/api/robot", authorization="Bearer wrong").status == 401
    name = server.cookie.partition("=")[0]
    assert server.ask("GET", "/", cookie=f"{name}=wrong").status == 401
    assert server.ask("GET", "/", cookie=f"{name}={server.token}").status == 401
    cookies = f"{server.cookie}; codebotler-{server.port}=x; {name.replace('operator', 'face')}=x"
    assert server.ask("GET", "/", cookie=cookies).status == 200
    assert server.ask("GET", "/", cookie=f"{server.cookie}x").status == 401
    assert server.ask("GET", "/", cookie="{=;;=").status == 401


def test_a_token_in_the_address_opens_pages_only(server: PageServer) -> None:
    """The addresses of other requests end up in logs."""
    for path in ("/api/robot", "/_nicegui/x"):
        answer = server.ask("GET", f"{path}?token={server.token}")
        assert (answer.status, "set-cookie" in answer.headers) == (401, False)


def test_tries_with_wrong_tokens_are_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Other users can read the words of a command, but not its variables.
    monkeypatch.setenv("CODEBOTLER_TOKEN", "one-that-a-person-made")
    with PageServer(tmp_path) as server:
        assert server.token == "one-that-a-person-made"
        cookie = server.cookie
        wrong = [server.ask("GET", f"/?token=wrong{n}").status for n in range(MAX_WRONG_TOKENS + 2)]
        assert wrong == [401] * MAX_WRONG_TOKENS + [429] * 2
        assert server.call("GET", "/api/robot").status == 429
        forwarded = server.ask("GET", f"/?token={server.token}", x_forwarded_for="10.9.8.7")
        assert (forwarded.status, forwarded.headers["retry-after"]) == (429, "60")
        assert server.ask("GET", "/api/robot", cookie=cookie).status == 200  # A cookie still works.


def test_the_link_names_the_address_at_which_the_page_listens(server: PageServer) -> None:
    """Browsers try `localhost` by IPv6 first, where another user of the machine may listen."""
    assert server.link.startswith(f"http://127.0.0.1:{server.port}/")


def test_the_link_leads_only_to_where_the_page_listens() -> None:
    with PageAddress(port=0).listen() as bound:
        port = bound.getsockname()[1]
        shown = {
            name: _address(PageAddress(name), bound) for name in ("127.0.0.1", "robot.example", "fd00::2")
        }
    assert shown["127.0.0.1"] == f"http://127.0.0.1:{port}/"
    assert shown["robot.example"] == f"http://robot.example:{port}/", "not at what this machine is called"
    assert shown["fd00::2"] == f"http://[fd00::2]:{port}/"
    with PageAddress("0.0.0.0", 0).listen() as bound:
        assert urlsplit(_address(PageAddress("0.0.0.0"), bound)).hostname == gethostname().lower()


def test_wrong_tokens_do_not_keep_a_generated_token_from_a_stop(tmp_path: Path) -> None:
    with PageServer(tmp_path) as server:
        wrong = [server.ask("GET", f"/?token=wrong{n}").status for n in range(MAX_WRONG_TOKENS + 1)]
        assert wrong[-1] == 429
        assert server.call("POST", "/api/stop").status == 202


def test_tries_are_counted_by_address_and_for_a_while() -> None:
    now = [0.0]
    access = Access("a token", "a face", now=lambda: now[0])
    for _ in range(MAX_WRONG_TOKENS):
        assert access.of_token("wrong", "here") is None
    with pytest.raises(TooManyTriesError):
        access.of_token("a token", "here")
    assert access.of_token("a token", "there") is Role.OPERATOR
    now[0] = WRONG_TOKEN_SECONDS
    assert access.of_token("a token", "here") is Role.OPERATOR


def test_a_generated_token_works_after_any_wrong_tokens() -> None:
    access = Access.from_options(None, "the tablet's own", open_to_all=False, is_private=True)
    for _ in range(MAX_WRONG_TOKENS):
        access.of_token("wrong", "here")
    assert access.of_token(access.operator or "", "here") is Role.OPERATOR
    for token in ("wrong", "the tablet's own"):
        with pytest.raises(TooManyTriesError):
            access.of_token(token, "here")


def test_the_number_of_stored_addresses_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.web.security.access.MAX_ADDRESSES", 3)
    access = Access("a token", "a face")
    for number in range(9):
        access.of_token("wrong", f"address {number}")
    assert len(access._wrong) == 3


def test_a_token_is_made_for_each_start() -> None:
    tokens = {Access().operator for _ in range(5)} | {Access().face for _ in range(5)}
    assert len(tokens) == 10
    assert all(token is not None and len(token) >= 32 for token in tokens)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--no-token", "--host", "0.0.0.0"], "--no-token cannot be combined"),
        *(
            pytest.param(["--no-token", *more], "--no-token cannot be combined", marks=pytest.mark.slow)
            for more in (
                *(["--host", host] for host in ("::", "0", "127.example", "")),
                ["--token", "x" * 20],
                ["--behind-proxy", "https://robot.example"],
            )
        ),
        (["--behind-proxy", "https://robot.example/missions"], ": /missions is already used by the page"),
        pytest.param(
            ["--behind-proxy", "https://robot.example/_nicegui/x"],
            ": /_nicegui is already used by the page",
            marks=pytest.mark.slow,
        ),
        (["--behind-proxy", "robot.example"], "https://HOST"),
        (["--token", "short"], "too short"),
        (["--host", "999.1.1.1"], "cannot listen"),
    ],
)
def test_careless_options_are_refused(tmp_path: Path, arguments: list[str], named: str) -> None:
    (tmp_path / "world.yaml").write_text("robot: a\nrooms: [a]\n")
    words = ("serve", "--world", "world.yaml", *arguments)
    with Forked("codebotler", *words, cwd=tmp_path, environment=ENVIRONMENT, preload=PAGE) as process:
        _, err = process.communicate(timeout=30)
    assert process.returncode == 2
    assert named in err


@pytest.mark.slow
def test_other_machines_need_the_token_and_the_output_says_so(tmp_path: Path) -> None:
    with PageServer(tmp_path, "--host", "0.0.0.0") as server:
        assert server.token
        assert "Other machines" in server.output
        for path in ("/", "/api/robot", "/static/page.css"):
            assert server.ask("GET", path).status == 401
            assert server.ask("GET", path, host=f"192.0.2.7:{server.port}").status == 401
            assert server.ask("GET", path, host="evil.example").status == 421
        assert server.call("GET", "/api/robot").status == 200
    with PageServer(tmp_path) as server:
        assert "Other machines" not in server.output


def test_without_a_token_this_machine_gets_in_but_no_other_page(tmp_path: Path) -> None:
    with PageServer(tmp_path, "--no-token") as server:
        assert "token" not in server.link
        assert server.ask("GET", "/").status == 200
        assert server.ask("POST", "/api/stop").status == 202
        assert server.ask("POST", "/api/stop", origin="http://evil.example").status == 403
        assert server.ask("GET", "/", host="evil.example").status == 421
        assert open_socket(server, origin="http://evil.example") == 403


# --- other pages


@pytest.mark.parametrize("host", ["evil.example", "localhost.evil.example", "10.0.0.1", "localhost.:80"])
def test_only_requests_to_our_own_names_are_answered(server: PageServer, host: str) -> None:
    """A page that leads its name here (DNS rebinding) still calls us by that name."""
    cookie = server.cookie
    assert server.ask("GET", "/api/robot", host=host, cookie=cookie).status == 421
    assert server.ask("GET", f"/?token={server.token}", host=host).status == 421


@pytest.mark.parametrize(
    ("hosts", "status"),
    [
        (["localhost"], 200),
        (["LocalHost:8080"], 200),
        (["127.0.0.1:80"], 200),
        (["[::1]:8080"], 200),
        (["robot.local:443"], 200),
        (["[::2]"], 421),
        (["evil.example"], 421),
        (["localhost.evil.example:80"], 421),
        ([], 400),
        ([""], 400),
        (["localhost", "localhost"], 400),
        (["localhost", "evil.example"], 400),
        (["evil.example", "localhost"], 400),
        (["evil.example:80@localhost:8080"], 400),
        (["user@localhost"], 400),
        (["localhost:@evil.example"], 400),
        (["localhost/evil.example"], 400),
        (["localhost?x"], 400),
        (["localhost#x"], 400),
        (["localhost, evil.example"], 400),
        (["localhost "], 400),
        (["localhost:"], 400),
        (["localhost:http"], 400),
        (["localhost:0"], 400),
        (["localhost:65536"], 400),
        (["::1"], 400),
        (["[localhost]"], 400),
        (["localh\xf6st"], 400),
    ],
)
def test_a_host_is_named_once_and_exactly(hosts: list[str], status: int) -> None:
    assert status_for("/api/robot", "an operator's", hosts) == status


def test_websockets_are_only_opened_under_our_own_names(server: PageServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    headers = {
        "Host": "evil.example",
        "Origin": "http://evil.example",
        "Cookie": server.cookie,
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    connection.request("GET", SOCKET, headers=headers)
    assert connection.getresponse().status == 403
    connection.close()


@pytest.mark.parametrize(
    "other", ["http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1:{port}", ""]
)
def test_other_pages_change_nothing_and_hear_nothing(server: PageServer, other: str) -> None:
    """Another port of this machine is another page, though browsers send the cookie with its requests."""
    cookie, from_there = server.cookie, other.format(port=server.port)
    assert server.ask("POST", "/api/stop", cookie=cookie, origin=from_there).status == 403
    assert server.ask("GET", "/api/robot", cookie=cookie, origin=from_there).status == 403
    assert open_socket(server, cookie=cookie, origin=from_there) == 403
    assert server.ask("POST", "/api/stop", cookie=cookie, origin=origin(server)).status == 202


def test_a_browser_that_sends_no_origin_changes_nothing(server: PageServer) -> None:
    assert server.ask("POST", "/api/stop", cookie=server.cookie).status == 403
    assert open_socket(server, cookie=server.cookie) == 403
    assert server.call("POST", "/api/stop").status == 202  # A client with the token is not a browser.


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_other_pages_embed_nothing(server: PageServer, site: str) -> None:
    cookie = server.cookie
    assert server.ask("GET", "/api/robot", cookie=cookie, sec_fetch_site=site).status == 403
    assert server.ask("GET", "/", cookie=cookie, sec_fetch_site=site, sec_fetch_mode="navigate").status == 200


def test_no_answer_allows_other_origins(server: PageServer) -> None:
    cookie, here = server.cookie, origin(server)
    for path in ("/", "/api/robot", "/_nicegui_ws/socket.io/?EIO=4&transport=polling"):
        for answer in (
            server.ask("GET", path, cookie=cookie, origin=here),
            server.ask("OPTIONS", path, cookie=cookie, origin=here, access_control_request_method="POST"),
        ):
            assert not [name for name in answer.headers if name.startswith("access-control")], path


def test_schemes_belong_to_an_origin() -> None:
    assert _is_same("https://robot:1", "robot:1", {"scheme": "wss"})
    assert not _is_same("http://robot:1", "robot:1", {"scheme": "https"})


# --- headers and sizes


def test_scripts_run_only_with_the_nonce_of_the_answer(server: PageServer) -> None:
    answers = [server.ask("GET", "/", cookie=server.cookie) for _ in range(2)]
    nonces = []
    for answer in answers:
        policy = answer.headers["content-security-policy"]
        (nonce,) = re.findall(r"'nonce-([\w-]{20,})'", policy)
        nonces.append(nonce)
        (scripts,) = re.findall(r"script-src ([^;]*)", policy)
        assert scripts.split() == ["'self'", f"'nonce-{nonce}'", "'unsafe-eval'"]
        tags = re.findall(r"<script[^>]*>", answer.text)
        assert len(tags) > 5
        assert all(f'nonce="{nonce}"' in tag for tag in tags)
        for rule in ("default-src 'none'", "base-uri 'none'", "frame-ancestors 'none'", "form-action 'self'"):
            assert rule in policy
    assert nonces[0] != nonces[1]


def test_every_answer_has_the_headers(server: PageServer) -> None:
    cookie = server.cookie
    for answer in (
        server.ask("GET", "/", cookie=cookie),
        server.ask("GET", "/api/robot", cookie=cookie),
        server.ask("GET", "/static/page.css", cookie=cookie),
        server.ask("GET", "/"),
        server.ask("GET", "/", accept="text/html"),
    ):
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["x-frame-options"] == "DENY"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["cross-origin-opener-policy"] == "same-origin"
        assert answer.headers["cross-origin-resource-policy"] == "same-origin"
        assert {"camera=()", "microphone=(self)"} <= set(answer.headers["permissions-policy"].split(", "))
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert "server" not in answer.headers


def test_bodies_have_a_size_limit(server: PageServer) -> None:
    huge = b'{"program": "' + b"x" * MAX_BODY_BYTES + b'"}'
    assert server.call("POST", "/api/check", huge).status == 413
    lying = server.ask(
        "POST", "/api/check", b"{}", authorization=f"Bearer {server.token}", content_length="-1"
    )
    assert lying.status in {400, 413}
    assert server.call("POST", "/api/check", {"program": "x" * 300_000}).status == 422


def test_a_body_with_too_large_a_length_is_refused_at_once(server: PageServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.putrequest("POST", "/api/check")
    connection.putheader("Authorization", f"Bearer {server.token}")
    connection.putheader("Content-Length", str(MAX_BODY_BYTES + 1))
    connection.endheaders()
    assert connection.getresponse().status == 413
    connection.close()


def test_no_more_of_a_body_is_passed_on_than_the_limit() -> None:
    passed: list[Message] = []

    async def behind(scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG001 - ASGI passes it
        while len(passed) < 9 and (not passed or passed[-1]["type"] == "http.request"):
            passed.append(await receive())

    async def receive() -> Message:
        return {"type": "http.request", "body": b"x" * (MAX_BODY_BYTES // 2), "more_body": True}

    async def send(message: Message) -> None:
        raise AssertionError(message)

    headers = [(b"host", b"localhost"), (b"authorization", b"Bearer an operator's")]
    scope = {"type": "http", "method": "POST", "path": "/api/check", "query_string": b"", "scheme": "http"}
    scope["headers"] = headers
    asyncio.run(
        Guard(behind, Access("an operator's", "a face's"), PageAddress(), 0, set().__contains__)(
            scope, receive, send
        )
    )
    assert [message["type"] for message in passed] == ["http.request", "http.request", "http.disconnect"]


def test_bodies_without_a_length_have_the_same_limit(server: PageServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.putrequest("POST", "/api/check")
    connection.putheader("Authorization", f"Bearer {server.token}")
    connection.putheader("Transfer-Encoding", "chunked")
    connection.endheaders()
    # Send only one byte too many, since later bytes might meet a closed connection.
    for size in (*[100_000] * (MAX_BODY_BYTES // 100_000), 1):
        connection.send(b"%x\r\n%b\r\n" % (size, b"x" * size))
    answer = connection.getresponse()
    detail = json.loads(answer.read())["detail"]
    assert (answer.status, "2,000,000 bytes" in detail) == (413, True)
    connection.close()


def test_agents_leave_room_for_people(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.web.security.guard.MAX_AGENT_REQUESTS", 2)
    statuses: list[int] = []

    async def main() -> None:
        released = asyncio.Event()

        async def behind(scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG001 - ASGI passes it
            if scope["path"] == "/mcp":
                await released.wait()
            await send({"type": "http.response.start", "status": 200, "headers": []})

        async def receive() -> Message:
            return {"type": "http.request", "body": b""}

        async def send(message: Message) -> None:
            if message["type"] == "http.response.start":
                statuses.append(message["status"])

        access = Access("an operator's", "a face's", agent="an agent's")
        guard = Guard(behind, access, PageAddress(), 0, set().__contains__)

        async def ask(path: str, token: str, length: int = 0) -> None:
            headers = [(b"host", b"localhost"), (b"authorization", f"Bearer {token}".encode())]
            headers.append((b"content-length", str(length).encode()))
            scope = {"type": "http", "method": "POST", "path": path, "query_string": b"", "scheme": "http"}
            await guard({**scope, "headers": headers}, receive, send)

        waiting = [asyncio.create_task(ask("/mcp", "an agent's")) for _ in range(2)]
        await asyncio.sleep(0)
        await ask("/mcp", "an agent's")
        await ask("/api/stop", "an operator's")
        released.set()
        await asyncio.gather(*waiting)
        await ask("/mcp", "an agent's")
        await ask("/mcp", "an agent's", MAX_AGENT_BODY_BYTES + 1)

    asyncio.run(main())
    assert statuses == [503, 200, 200, 200, 200, 413]


# --- roles


def status_for(path: str, token: str, hosts: Sequence[str] = ("localhost",)) -> int:
    """Return the guard's own status for a token, which is 200 if it lets the request through."""
    sent: list[Message] = []

    async def behind(scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG001 - ASGI passes it
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        return {"type": "http.request", "body": b""}

    named = [(b"host", host.encode("latin-1")) for host in hosts]
    headers = [*named, (b"authorization", f"Bearer {token}".encode())]
    scope = {"type": "http", "method": "POST", "path": path, "query_string": b"", "scheme": "http"}
    scope["headers"] = headers
    place = PageAddress(names=("robot.local",))
    guard = Guard(behind, Access("an operator's", "a face's"), place, 0, set().__contains__)
    asyncio.run(guard(scope, receive, send))
    return int(sent[0]["status"])


@pytest.mark.parametrize(
    "path", ["/", "/missions", "/api", "/api/missions", "/api/stop", "/faces", "/api/faces"]
)
def test_a_face_cannot_run_programs(path: str) -> None:
    assert status_for(path, "a face's") == 403
    assert status_for(path, "an operator's") == 200
    assert status_for("/face", "a face's") == 200
    assert status_for("/api/face/said", "a face's") == 200


# --- addresses


def test_the_page_knows_its_own_names() -> None:
    here, everywhere = PageAddress(), PageAddress("0.0.0.0", names=("Robot.Local",))
    assert (here.is_loopback, "localhost" in here.hosts) == (True, True)
    assert (everywhere.is_loopback, "robot.local" in everywhere.hosts) == (False, True)


def test_the_default_port_moves_on_and_a_port_that_was_named_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with PageAddress(port=0).listen() as first, PageAddress(port=0).listen() as other:
        taken, free = first.getsockname()[1], other.getsockname()[1]
        other.close()
        monkeypatch.setattr("codebotler.web.security.access.PAGE_PORTS", (taken, free))
        with PageAddress().listen() as found:
            assert found.getsockname()[1] == free
        with pytest.raises(UserError, match=f"port {taken} is already in use"):
            PageAddress(port=taken).listen()


# --- behind a proxy

BEHIND = "https://robot.example/robot"


@pytest.fixture(scope="module")
def proxied(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    options = ("--behind-proxy", BEHIND, "--behind-proxy", "https://lab.example:8443")
    with PageServer(tmp_path_factory.mktemp("proxied"), *options) as server:
        yield server


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("robot.example", "https://robot.example", 202),
        ("robot.example:443", "https://robot.example", 202),
        ("lab.example:8443", "https://lab.example:8443", 202),
        ("robot.example", "http://robot.example", 403),
        ("robot.example", "https://evil.example", 403),
        ("robot.example", "https://lab.example:8443", 403),
        ("robot.example", "null", 403),
        ("lab.example", "https://lab.example:8443", 403),
        ("lab.example:8443", "https://lab.example", 403),
        ("localhost", "https://robot.example", 403),
        ("localhost", "http://localhost", 202),
        ("evil.example", "https://evil.example", 421),
    ],
)
def test_only_the_origins_of_the_proxies_count(
    proxied: PageServer, host: str, origin: str, status: int
) -> None:
    for path in ("/api/stop", "/robot/api/stop") if host.startswith("robot") else ("/api/stop",):
        answer = proxied.ask("POST", path, host=host, origin=origin, cookie=proxied.cookie)
        assert answer.status == status, path
    refused = 401 if status == 202 else status
    assert proxied.ask("POST", "/api/stop", host=host, origin=origin).status == refused


def test_a_proxy_opens_nothing_without_the_token(proxied: PageServer) -> None:
    for path in ("/robot/", "/robot/api/robot", "/robot/static/page.css", "/"):
        assert proxied.ask("GET", path, host="robot.example").status == 401, path
    assert open_socket(proxied, host="robot.example", origin="https://robot.example") == 403


@pytest.mark.parametrize(
    ("host", "given", "leads", "path"),
    [
        ("robot.example", "/robot/missions", "/missions", "/robot"),
        ("robot.example", "/missions", "/missions", "/robot"),
        ("robot.example", "/robot", "/", "/robot"),
        ("lab.example:8443", "/missions", "/missions", ""),
        ("localhost", "/missions", "/missions", ""),
    ],
)
def test_the_link_leads_to_the_path_behind_the_proxy(
    proxied: PageServer, host: str, given: str, leads: str, path: str
) -> None:
    answer = proxied.ask("GET", f"{given}?token={proxied.token}", host=host)
    inside = path + proxied.path
    assert (answer.status, answer.headers["location"]) == (303, inside + leads)
    parts = {part.strip().lower() for part in answer.headers["set-cookie"].split(";")}
    assert f"path={inside}" in parts
    assert ("secure" in parts) == (host != "localhost")


@pytest.mark.parametrize("prefix", ["//evil.example", "/elsewhere"])
def test_no_header_chooses_the_path(proxied: PageServer, prefix: str) -> None:
    token = f"Bearer {proxied.token}"
    page = proxied.ask("GET", "/robot/", host="robot.example", authorization=token, x_forwarded_prefix=prefix)
    assert page.status == 200
    assert prefix not in page.text


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "localhost", "origin": "https://localhost"},
        {"host": "localhost", "origin": "https://localhost:8443"},
        {"host": "127.0.0.1", "origin": "https://new.example", "sec_fetch_site": "same-origin"},
        {"host": "robot.example", "origin": "http://robot.example"},
        {"host": "lab.example", "origin": "https://lab.example:8443"},
    ],
)
def test_refusal_of_a_proxys_origin_names_the_option(proxied: PageServer, headers: dict[str, str]) -> None:
    answer = proxied.ask("POST", "/api/stop", cookie=proxied.cookie, **headers)
    assert (answer.status, "--behind-proxy" in answer.data["detail"]) == (403, True), answer.text


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("https://host", OuterAddress("https", "host")),
        ("HTTPS://Host:443/", OuterAddress("https", "host")),
        ("https://host:8443/a/B/", OuterAddress("https", "host:8443", "/a/B")),
        ("http://[::1]:80", OuterAddress("http", "[::1]")),
        ("http://10.0.0.1:443", OuterAddress("http", "10.0.0.1:443")),
    ],
)
def test_addresses_of_proxies_are_read(text: str, address: OuterAddress) -> None:
    assert OuterAddress.parse(text) == address
    assert OuterAddress.parse(address.page) == address


@pytest.mark.parametrize(
    "text",
    [
        *(
            "host",
            "ftp://host",
            "https://",
            "https://a b",
            "https://host/?a",
            "https://host/#a",
            "https://u@host",
        ),
        *("https://host//a", "https://host/../a", "https://host/.", "https://host/a%2fb", "https://host:0"),
        *("https://hôst", "https://host:123456", "https://host/ä", "https://host\n"),
    ],
)
def test_invalid_addresses_of_proxies_are_refused(text: str) -> None:
    with pytest.raises(UserError, match="write https://HOST"):
        OuterAddress.parse(text)


def test_a_host_has_one_address() -> None:
    with pytest.raises(UserError, match="twice"):
        proxies_in_front(["https://host/a", "https://host/b"])
    assert len(proxies_in_front(["https://host/a", "https://host:443/a/"])) == 1


def test_config_names_proxies_unless_the_command_line_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CODEBOTLER_HOME", str(tmp_path))
    assert proxies_in_front(None) == ()
    config = tmp_path / "config.yaml"
    config.write_text("behind_proxy: [https://a.example, https://b.example/robot]\n")
    assert [one.page for one in proxies_in_front(None)] == ["https://a.example/", "https://b.example/robot/"]
    assert [one.page for one in proxies_in_front(["https://c.example"])] == ["https://c.example/"]
    config.write_text("model: recorded:hasty\nbehind_proxy:\n- nowhere\n")
    with pytest.raises(UserError) as caught:
        proxies_in_front(None)
    assert (caught.value.file, caught.value.line) == (config, 2)


def test_several_starts_at_once_have_one_secret(tmp_path: Path) -> None:
    for number in range(20):
        with ThreadPoolExecutor(4) as pool:
            secrets = [*pool.map(lambda _, home=tmp_path / str(number): read_cookie_secret(home), range(4))]
        assert len({*secrets}) == 1
        assert [file.name for file in (tmp_path / str(number)).iterdir()] == ["cookie-secret"]
