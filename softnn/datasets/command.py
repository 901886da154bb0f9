"""`softnn data`: list, show, fetch and verify public recordings."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from softnn.datasets import (
    MIRROR,
    PublishedSet,
    fetch,
    published,
    published_set,
    verify,
)
from softnn.readers.tidy import data_folder


def add_data(commands: Any) -> None:
    parser = commands.add_parser(
        "data",
        help="public recordings: list, show, fetch, verify",
        description="Public recordings of soft materials, from where their authors "
        "keep them. They go into SOFTNN_DATA, or else into a cache folder.",
        epilog="Example: softnn data fetch vhb4910, then "
        "softnn diagnose FOLDER/vhb4910/tidy --out found",
    )
    doings = parser.add_subparsers(dest="doing", required=True, metavar="DOING")
    doings.add_parser("list", help="the sets, a line each").set_defaults(run=_list)
    show = doings.add_parser("show", help="where a set comes from, what its files are")
    get = doings.add_parser("fetch", help="download, check and read sets")
    check = doings.add_parser("verify", help="compare fetched sets with their hashes")
    show.add_argument("name", metavar="SET").completer = _names
    show.set_defaults(run=_show)
    get.add_argument("names", nargs="+", metavar="SET").completer = _names
    get.add_argument(
        "--mirror", default=MIRROR, metavar="URL", help=f"in place of {MIRROR}"
    )
    get.set_defaults(run=_fetch)
    check.add_argument("names", nargs="*", metavar="SET").completer = _names
    check.set_defaults(run=_verify)


def _names(**_: Any) -> list[str]:
    return list(published())


def _list(_: argparse.Namespace) -> int:
    for one in published().values():
        print(f"{one.name:<20}{_state(one):<10}{one.material}: {one.about}")
    print(f"in {data_folder()}")
    return 0


def _state(one: PublishedSet) -> str:
    if (one.folder / "source.json").is_file():
        return "here"
    return f"{len(one.files)} file(s)" if one.files else "by hand"


def _show(arguments: argparse.Namespace) -> int:
    one = published_set(arguments.name)
    for what in ("material", "about", "address", "licence", "reference", "notes"):
        if getattr(one, what):
            print(f"{what:<12}{getattr(one, what)}")
    print(f"{'folder':<12}{one.folder}")
    for file in one.files:
        options = [f"{k} {v:g}" for k, v in file.options.items()]
        how = ", ".join([file.test, f"read as {file.reader}", *options])
        print(f"{'file':<12}{file.path}\n{'':<12}{how}")
        print(f"{'':<12}sha256 {file.sha256}")
    return 0


def _fetch(arguments: argparse.Namespace) -> int:
    for name in arguments.names:
        folder = fetch(name, arguments.mirror)
        print(f"{name}: {folder} (licence: {published_set(name).licence})")
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    names = arguments.names or [
        one.name for one in published().values() if _state(one) == "here"
    ]
    if not names:
        print(f"no set is fetched into {data_folder()}")
    bad = False
    for name in names:
        wrong = verify(name)
        print("\n".join(wrong), file=sys.stderr) if wrong else print(f"{name}: whole")
        bad = bad or bool(wrong)
    return 2 if bad else 0
