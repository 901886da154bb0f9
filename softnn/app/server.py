"""The server of `softnn app`: one process, pages by NiceGUI, work by others."""

from __future__ import annotations

import argparse
import secrets
import socket
import sys
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path

from nicegui import app, ui

from softnn.app import pages
from softnn.app.guard import HERE, Guard
from softnn.app.runs import Runs
from softnn.contracts import InputError
from softnn.mismatch.batch import writable

SLACK = 10**6  # bytes of a request besides the file in it


def serve(arguments: argparse.Namespace) -> int:
    """Serve until ctrl-C; the exit code."""
    host, port, out = arguments.host, arguments.port, Path(arguments.out).resolve()
    writable(out)
    local = _is_local(host)
    token = secrets.token_urlsafe(24) if arguments.token or not local else None
    _free(host, port)
    runs = Runs()
    limits = pages.Limits(arguments.max_mb * 10**6, arguments.max_files)
    pages.register(out, runs, limits, local)
    app.add_middleware(Guard, token=token, local=local, most=limits.bytes_ + SLACK)
    app.on_shutdown(runs.close)
    shown = host if local else socket.gethostname()
    address = f"http://{f'[{shown}]' if ':' in shown else shown}:{port}/"
    address += f"?token={token}" if token else ""
    print(f"softnn app: {address}\nResults are kept in {out}. Ctrl-C ends it.")
    sys.stdout.flush()
    path = f"/?token={token}" if token else "/"
    with suppress(KeyboardInterrupt):  # which uvicorn raises again once it has ended
        ui.run(
            host=host,
            port=port,
            title="softnn",
            dark=None,  # as the visitor's system has it
            language="en-GB",
            tailwind=False,
            reload=False,
            show=False if arguments.no_browser else path,
            show_welcome_message=False,
            favicon=pages.ICON,
        )
    return 0


def _is_local(host: str) -> bool:
    if host in HERE:
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def _free(host: str, port: int) -> None:
    """Raises `InputError` where something else listens, or the address is not ours."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            raise InputError(
                f"cannot serve at {host}, port {port}: {error.strerror or error}; "
                f"give another --port, such as {port + 1 if port < 65535 else 8651}"
            ) from None
