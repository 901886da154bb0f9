"""What do more processes bring to a study, and what does killing them cost it?

    python -m studies.scaling --server postgresql+psycopg://USER@HOST/DATABASE

Trials of the joint study in full size, a grid of them, which are the same whoever does
them, shared by one and by two processes through a database server: how many are
finished in a minute, and for what share of the time each process was at a trial, which
is what queue and server leave of it. Then a study on few samples, by one process in a
file and by two on the server, is killed (-9) at random moments, five of them in the
first five seconds, the others soon after one to three more trials were finished, and
started again: are trials lost, or done twice?
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from bench.reporting import between
from softnn.contracts import InputError
from softnn.study import common

ROOT = Path(__file__).resolve().parents[1]
MARK = "<!-- made by python -m studies.scaling -->"
SMALL = ("--samples", "25", "--folds", "3", "--neurons", "1:3")
WHOLE = ("--sampler", "grid", "--neurons", "4:8")  # the same trials, however many share
EARLY, EARLY_S = 5, 5.0
KINDS = {1: "one process, SQLite file", 2: "two processes, PostgreSQL"}


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.scaling`; returns the exit code."""
    made = common.parser("scaling", __doc__)
    made.add_argument("--server", help="postgresql+psycopg://...; made tables stay")
    made.add_argument(
        "--kills-only", action="store_true", help="throughput as in the last result"
    )
    made.add_argument(
        "--trials", type=int, default=120, help="of a study that is killed (120)"
    )
    made.add_argument("--kills", type=int, default=20, help="of each kind (20), or 0")
    return common.guarded(lambda: run(made.parse_args(argv)))


def run(a: argparse.Namespace) -> None:
    if a.smoke:  # no server: what one process in a file stands
        killed = {KINDS[1]: killing(None, 1, 1, 4, a.seed)}
        written([], killed, a)
        return
    if not a.server or a.server.startswith("sqlite"):
        raise InputError("--server is needed, an address such as postgresql+psycopg:")
    if a.kills_only:
        last = (common.RESULTS / "scaling.json").read_text(encoding="utf-8")
        rows = json.loads(last)["throughput"]
    else:
        rows = [throughput(a.server, count, a.seed) for count in (1, 2)]
    killed = {
        KINDS[count]: killing(where, count, a.kills, a.trials, a.seed)
        for count, where in ((1, None), (2, a.server))
        if a.kills
    }
    written(rows, killed, a)


def written(
    rows: list[dict[str, Any]], killed: dict[str, Any], a: argparse.Namespace
) -> None:
    headline: dict[str, Any] = {}
    if rows:
        one, two = (row["trials_per_min"] for row in rows)
        headline["throughput_of_two"] = two / one
        headline["busy_of_two"] = rows[1]["busy"]
    if killed:
        for name in ("kills", "lost", "twice"):
            headline[name] = sum(k[name] for k in killed.values())
    body = {"throughput": rows, "kills": killed, "trials": a.trials}
    folder = common.results_folder(a.smoke, a.publish)
    path = common.write_result("scaling", headline, body, seed=a.seed, folder=folder)
    found = json.loads(path.read_text(encoding="utf-8"))
    text = f"{report(rows, killed)}\n\n{common.made_with(found)}"
    print(f"{text}\n\nresult: {path}")
    page = ROOT / "docs" / "scaling.md"
    if a.publish and not a.smoke:
        new = between(MARK, page.read_text(encoding="utf-8"), text)
        page.write_text(new, encoding="utf-8")


def report(rows: list[dict[str, Any]], killed: dict[str, Any]) -> str:
    parts = []
    if rows:
        cells = [
            [
                str(r["processes"]),
                f"{r['trials_per_min']:.1f}",
                common.percent(r["busy"], 0),
                f"{r['load']:.1f} on {r['cores']} cores",
            ]
            for r in rows
        ]
        header = ["processes", "trials a minute", "busy", "load of the machine"]
        parts.append(common.markdown(header, cells))
    if not killed:
        return "\n\n".join([*parts, "Kills were not measured in this run."])
    cells = [
        [kind, *(str(k[n]) for n in ("kills", "early", "trials", "lost", "twice"))]
        for kind, k in killed.items()
    ]
    header = ["study", "kills", "within 5 s", "trials", "lost", "done twice"]
    return "\n\n".join([*parts, common.markdown(header, cells)])


def throughput(server: str, count: int, seed: int) -> dict[str, Any]:
    """Trials a minute of `count` workers, from the first start to the last end."""
    with tempfile.TemporaryDirectory() as folder:
        about = [*study(server, fresh_seed(seed), WHOLE), "--worker"]
        before = newest(server)
        children = [started(about, Path(folder)) for _ in range(count)]
        for child in children:
            finish(child)
        rows = trials_of(server, before)
    begin, end = min(r[1] for r in rows), max(r[2] for r in rows)
    wall = (end - begin).total_seconds()
    busy = sum((r[2] - r[1]).total_seconds() for r in rows) / (count * wall)
    return {
        "processes": count,
        "trials": len(rows),
        "trials_per_min": 60 * len(rows) / wall,
        "busy": busy,
        "load": os.getloadavg()[0],
        "cores": os.cpu_count(),
    }


def killing(
    server: str | None, count: int, kills: int, trials: int, seed: int
) -> dict[str, Any]:
    """A study whose processes are all killed again and again, and then let finish."""
    rng = random.Random(seed)
    kept: set[tuple[int, Any, Any]] = set()
    lost = done = early = 0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        address = server or f"sqlite:///{folder}/mlruns/optuna.db"
        size = (*SMALL, "--trials", str(trials))
        about = study(server, fresh_seed(seed), size)
        before = newest(address)
        while done < kills:
            soon = done < EARLY
            children = [
                started([*about, *["--worker"] * (i > 0)], folder) for i in range(count)
            ]
            if soon:
                time.sleep(rng.uniform(0, EARLY_S))
            else:
                more = len(kept) + rng.randint(1, 3)
                while any(child.poll() is None for child in children):
                    if len(trials_of(address, before)) >= more:
                        break
                    time.sleep(0.1)
                time.sleep(rng.uniform(0, 1))
            ended = all(child.poll() is not None for child in children)
            for child in children:
                child.kill()
                child.communicate()
            if ended:
                break
            done, early = done + 1, early + soon
            now = set(trials_of(address, before))
            lost += len(kept - now)
            kept = now
        finish(started(about, folder))
        now = set(trials_of(address, before))
    slots = len({slot for slot, *_ in now})
    return {
        "kills": done,
        "early": early,
        "trials": len(now),
        "lost": lost + len(kept - now) + max(0, trials - slots),
        "twice": len(now) - min(slots, trials),
    }


def study(server: str | None, seed: int, size: Sequence[str]) -> list[str]:
    command = ["-m", "studies.architectures", *size, "--out", "o", "--seed", str(seed)]
    return command + (["--storage", server] if server else [])


def fresh_seed(seed: int) -> int:
    """A study of its own: trials under one name are never run again."""
    return seed + int(time.time()) % 10**6


def started(about: Sequence[str], folder: Path) -> subprocess.Popen[str]:
    known = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, *about],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": known, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def finish(child: subprocess.Popen[str]) -> None:
    said, _ = child.communicate()
    if child.returncode:
        raise InputError(f"a study ended with {child.returncode}: {said[-400:]}")


@contextmanager
def opened(address: str) -> Iterator[Any]:
    """Optuna's storage; None where there is no file yet: it has its name when whole."""
    import optuna

    if address.startswith("sqlite") and not Path(address[10:]).exists():
        yield None
        return
    backend = optuna.storages.RDBStorage(address)
    try:
        yield backend
    finally:
        backend.remove_session()
        backend.engine.dispose()


def newest(address: str) -> int:
    """The number of the newest study, 0 where there is none."""
    with opened(address) as backend:
        every = backend.get_all_studies() if backend else []
    return max((s._study_id for s in every), default=0)


def trials_of(address: str, before: int) -> list[tuple[int, datetime, datetime]]:
    """Slot, begin and end of finished trials of the study that came after `before`."""
    number = newest(address)
    if number <= before:
        return []
    with opened(address) as backend:
        every = backend.get_all_trials(number)
    done = [t for t in every if t.values and t.user_attrs.get("explored")]
    return [
        (
            t.user_attrs.get("slot", place),
            t.datetime_start or datetime.min,
            t.datetime_complete or datetime.min,
        )
        for place, t in enumerate(done)
    ]
