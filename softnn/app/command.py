"""`softnn app`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from softnn.contracts import InputError

PORT = 8650


def add_app(commands: Any) -> None:
    parser = commands.add_parser(
        "app",
        help="the same in a browser: drop files, look, diagnose, download",
        description="Serve pages to this machine alone and open a browser on them: "
        "drop recordings, check their columns and sizes, diagnose, read the report, "
        "download the model. Ctrl-C ends the server and its runs.",
        epilog="Example: softnn app --out my_results",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("softnn-app"),
        metavar="DIR",
        help="where dropped files and results are kept (softnn-app)",
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="serve other machines too, who then need the token that is printed",
    )
    parser.add_argument("--port", type=int, default=PORT, metavar="N")
    parser.add_argument(
        "--token",
        action="store_true",
        help="ask for a token on this machine too, where others have accounts",
    )
    parser.add_argument(
        "--max-mb",
        type=int,
        default=100,
        metavar="MB",
        help="largest file taken (100)",
    )
    parser.add_argument(
        "--max-files",
        type=int,
        default=200,
        metavar="N",
        help="files of one project, at most (200)",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address, open nothing"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    for option in ("port", "max_mb", "max_files"):
        most = 65535 if option == "port" else 10_000
        if not 1 <= getattr(arguments, option) <= most:
            raise InputError(
                f"--{option.replace('_', '-')} is {getattr(arguments, option)}; "
                f"allowed is 1 to {most}"
            )
    try:
        from softnn.app.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "nicegui":
            raise
        raise InputError(
            "softnn app needs NiceGUI, which is not installed: pip install "
            "'softnn[app]'"
        ) from None
    return serve(arguments)
