"""Who may come in, and how much they may send: before anything else sees a request.

On this machine alone the browser's own words decide: a page of another site may neither
use another name for this address (`Host`) nor send anything (`Origin`). Elsewhere a
token is asked for as well, once in the address, then in a cookie.
"""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

COOKIE = "softnn_token"
HERE = ("127.0.0.1", "localhost", "::1")

Scope = dict[str, Any]


class Guard:
    """ASGI middleware. `token`: None where none is asked for; `most` in bytes."""

    def __init__(self, app: Any, token: str | None, local: bool, most: int) -> None:
        self.app, self.token, self.local, self.most = app, token, local, most

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {
            k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]
        }
        if self.local and _host(headers.get("host", "")) not in HERE:
            await _refuse(scope, send, 403, "Open this page as http://127.0.0.1")
        elif not _same_site(headers):
            await _refuse(scope, send, 403, "Nothing is taken from another site.")
        elif self.token is not None and not self._knows(scope, headers):
            given = parse_qs(scope.get("query_string", b"").decode("latin-1"))
            if scope["type"] == "http" and self._is(given.get("token", [""])[0]):
                await _welcome(scope, send, self.token)
            else:
                await _refuse(
                    scope, send, 401, "Open the address that softnn app printed."
                )
        elif _length(headers) > self.most:
            await _refuse(scope, send, 413, "More than this server takes at once.")
        else:
            await self.app(scope, _limited(receive, self.most), send)

    def _knows(self, scope: Scope, headers: dict[str, str]) -> bool:
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        return COOKIE in cookies and self._is(cookies[COOKIE].value)

    def _is(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), str(self.token).encode())


def _host(text: str) -> str:
    try:
        return urlsplit(f"//{text}").hostname or ""
    except ValueError:
        return ""


def _same_site(headers: dict[str, str]) -> bool:
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc == headers.get("host")


def _length(headers: dict[str, str]) -> int:
    text = headers.get("content-length", "0")
    return int(text) if text.isdigit() else 0


def _limited(receive: Any, most: int) -> Any:
    """The same messages; the connection counts as gone once they are too many."""
    taken = 0

    async def limited() -> dict[str, Any]:
        nonlocal taken
        message: dict[str, Any] = await receive()
        if message["type"] == "http.request":
            taken += len(message.get("body", b""))
            if taken > most:
                return {"type": "http.disconnect"}
        return message

    return limited


async def _refuse(scope: Scope, send: Any, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    await _answer(send, status, [(b"content-type", b"text/plain")], text.encode())


async def _welcome(scope: Scope, send: Any, token: str) -> None:
    """Keep the token in a cookie and take it out of the address."""
    cookie = f"{COOKIE}={token}; HttpOnly; SameSite=Lax; Path=/"
    path = scope["path"] if scope["path"].startswith("/") else "/"
    headers = [
        (b"location", ("/" + path.lstrip("/")).encode("latin-1", "replace")),
        (b"set-cookie", cookie.encode()),
    ]
    await _answer(send, 303, headers, b"")


async def _answer(
    send: Any, status: int, headers: list[tuple[bytes, bytes]], body: bytes
) -> None:
    headers = [*headers, (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
