"""Finished rows on disk, so that a long run can be stopped and gone on with."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from bench.recordings.reporting import Row
from softnn.study.common import plain


class Store:
    """Rows by key, a line of JSON each; half a line at the end is passed over."""

    def __init__(self, path: Path, fresh: bool = False) -> None:
        self.path = path
        self.rows: dict[str, Row] = {}
        if fresh:
            path.unlink(missing_ok=True)
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                try:
                    found = json.loads(line)
                except json.JSONDecodeError:
                    continue
                self.rows[found["key"]] = Row(**found["row"])

    def put(self, key: str, row: Row) -> None:
        self.rows[key] = row
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(plain({"key": key, "row": asdict(row)})) + "\n")
