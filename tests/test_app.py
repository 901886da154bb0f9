"""What lies behind the pages: names, limits, who may come in, processes."""

import asyncio
import json
import os
import time
from concurrent.futures import ThreadPoolExecutor

import pandas as pd
import pytest
from made import histories, write_case

pytest.importorskip("nicegui", reason="no NiceGUI: pip install 'softnn[app]'")

from softnn.app import project as projects
from softnn.app import work
from softnn.app.card import worded
from softnn.app.guard import Guard
from softnn.app.pages import Limits, received, sizing
from softnn.app.runs import Runs
from softnn.cli import main
from softnn.contracts import InputError
from softnn.mismatch.api import to_case

LIMITS = Limits(1000, 3)


async def chunks(*parts):
    for part in parts:
        yield part


def done(work):
    """The result of a coroutine, in a loop of its own: a browser's may be running."""
    with ThreadPoolExecutor(1) as other:
        return other.submit(asyncio.run, work).result()


def sent(project, name, *parts, limits=LIMITS):
    return done(received(project, name, chunks(*parts), limits))


# -- what is dropped -------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/passwd",
        "..\\..\\evil.csv",
        "/etc/cron.d/x",
        "..",
        "",
        ".hidden",
        "a\x00b\n.csv",
        "x" * 300 + ".csv",
        "<img src=x onerror=alert(1)>.csv",
        "\u202ecsv.exe",
        "C:\\Users\\a.csv",
    ],
)
def test_a_dropped_file_lands_in_its_project_whatever_it_is_called(tmp_path, name):
    project = projects.new(tmp_path)
    place = sent(project, name, b"1")
    assert place.parent == project.folder / "files"
    assert place.resolve().parent == place.parent
    assert not set("/\\<>\n\x00") & set(place.name)
    assert len(place.name) <= projects.LONGEST
    assert [f for f in tmp_path.rglob("*") if f.is_file()] == [place]


def test_two_files_of_one_name_are_both_kept(tmp_path):
    project = projects.new(tmp_path)
    names = [sent(project, n, b"1").name for n in ("a.csv", "A.csv", "a.csv")]
    assert names == ["a.csv", "A-2.csv", "a-3.csv"]


def test_what_is_too_large_or_too_many_leaves_nothing(tmp_path):
    project = projects.new(tmp_path)
    with pytest.raises(InputError, match="over 0 MB; split it"):
        sent(project, "a.csv", b"1" * 600, b"1" * 600)
    assert project.files == []
    for i in range(3):
        sent(project, f"{i}.csv", b"1")
    with pytest.raises(InputError, match="holds 3 files at most"):
        sent(project, "4.csv", b"1")


@pytest.mark.parametrize(
    "name", ["..", "../x", "20261128-143205-1f3a90c2/..", "", "a", "%2e%2e", "mlruns"]
)
def test_a_project_is_opened_by_its_own_name_alone(tmp_path, name):
    (tmp_path / "mlruns").mkdir()
    with pytest.raises(InputError, match="there is no project of that name"):
        projects.opened(tmp_path, name)


def test_a_new_project_is_found_again_and_listed_once_it_has_a_file(tmp_path):
    project = projects.new(tmp_path)
    assert projects.opened(tmp_path, project.id) == project
    assert list(projects.listed(tmp_path)) == []
    sent(project, "a.csv", b"1")
    assert list(projects.listed(tmp_path)) == [project]


def test_a_choice_or_a_file_makes_the_report_before_it_old(tmp_path):
    project = projects.new(tmp_path)
    seen = [project.digest]
    sent(project, "a.csv", b"1")
    seen.append(project.digest)
    project.set_options("a.csv", {"length_mm": 33.0})
    seen.append(project.digest)
    project.choose(base="hooke")
    seen.append(project.digest)
    assert len(set(seen)) == 4
    project.choose(title="of no matter", network={"folds": "3"})
    assert project.digest == seen[-1]


# -- what is understood ----------------------------------------------------------------


def machine_file(folder, **change):
    chunk = histories()[0]
    table = {
        "Time (s)": chunk.time_s,
        "Extension (mm)": 33 * chunk.strain,
        "Load (N)": 18 * chunk.strain,
    }
    file = folder / "export.csv"
    pd.DataFrame(table | change).to_csv(file, index=False)
    return file


def test_a_file_without_sizes_says_so_and_names_its_columns(tmp_path):
    told = work.understand(machine_file(tmp_path), {}, False)
    assert told["columns"] == ["Time", "Extension", "Load"]
    assert told["recordings"] == []
    assert "section" in worded(told["error"])
    assert "--" not in worded(told["error"])
    assert str(tmp_path) not in told["error"]


def test_sizes_set_with_a_click_are_what_the_command_reads(tmp_path, capsys):
    file = machine_file(tmp_path)
    told = work.understand(file, {"length_mm": 33.0, "area_mm2": 18.0}, False)
    assert (told["error"], told["doubt"]) == ("", "")
    (one,) = told["recordings"]
    assert one["geometry"] == {"length_mm": 33.0, "area_mm2": 18.0}
    assert one["sign"] == "tension (positive)"
    # 18 N over 18 mm2 at the strain of 1: 1 MPa of stiffness.
    (_, _, strain), (_, unit, stress) = one["ranges"]
    assert stress == pytest.approx(strain)
    assert unit == "MPa"
    assert main(["read", str(file), "--length", "33", "--area", "18"]) == 0
    assert all(f"{v:.4g}" in capsys.readouterr().out for v in strain[:1])


class Here:
    """Runs what the pages ask for in this process."""

    async def ask(self, work, *given):
        return work(*given)


SIZES = b"File;Specimen;Length [cm];Area [mm2]\nexport.csv;A;3,3;18\nx.csv;B;4;20\n"


def test_a_table_of_sizes_is_taken_before_and_after_its_files(tmp_path):
    (lab := tmp_path / "lab").mkdir()
    project = projects.new(tmp_path / "out")
    content = machine_file(lab).read_bytes()
    many = Limits(100_000, 9)
    sent(project, "export.csv", content, limits=many)
    project.set_options("export.csv", {"width_mm": 2.0, "length_mm": 9.0})
    table = sent(project, "specimens.csv", SIZES)
    done(sizing(project, table, Here()))
    assert [f.name for f in project.files] == ["export.csv"]
    own = {"length_mm": 33.0, "area_mm2": 18.0, "specimen": "A"}
    assert project.options("export.csv") == own
    sent(project, "x.csv", content, limits=many)
    project.sized("x.csv")
    assert project.options("x.csv")["length_mm"] == 40
    first, second = work.read_all(project)
    assert (first.specimen, second.specimen) == ("A", "B")
    assert first.geometry.length_mm == 33
    # As `softnn diagnose` takes it of a folder.
    (lab / "specimens.csv").write_bytes(SIZES.replace(b"x.csv;B;4;20\n", b""))
    (one,) = to_case(lab).recordings
    assert (one.specimen, one.geometry) == (first.specimen, first.geometry)


def test_a_table_of_sizes_that_cannot_be_leaves_nothing(tmp_path):
    project = projects.new(tmp_path)
    table = sent(project, "specimens.csv", b"file,length_mm\na.csv,-3\n")
    with pytest.raises(InputError, match="no size") as error:
        done(sizing(project, table, Here()))
    assert str(tmp_path) not in str(error.value)
    assert project.files == []
    assert project.sizes == {}


def test_reversed_force_is_in_doubt_until_it_is_taken_as_it_is(tmp_path):
    load = -18 * histories()[0].strain
    file = machine_file(tmp_path, **{"Load (N)": load})
    sizes = {"length_mm": 33.0, "area_mm2": 18.0}
    told = work.understand(file, sizes, False)
    assert told["doubt"]
    assert "--" not in worded(told["doubt"])
    assert work.understand(file, sizes, True)["doubt"] == ""


@pytest.mark.parametrize("content", [b"", b"%PDF-1.4\n1 0 obj", b"\x00\x01\x02" * 99])
def test_a_file_that_is_no_recording_gets_one_line(tmp_path, content):
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    told = work.understand(file, {}, False)
    assert told["recordings"] == []
    assert told["no_test"]  # passed over, as in a folder
    assert "\n" not in told["no_test"]


# -- who may come in -------------------------------------------------------------------


def answer(guard, headers, query="", kind="http", body=()):
    """The first message that a request gets, and the headers with it."""
    got = []
    pending = list(body)

    async def receive():
        if pending:
            part = pending.pop(0)
            return {"type": "http.request", "body": part, "more_body": bool(pending)}
        return {"type": "http.disconnect"}

    async def send(message):
        got.append(message)

    scope = {
        "type": kind,
        "path": "/results",
        "query_string": query.encode(),
        "headers": [(k.encode(), v.encode()) for k, v in headers.items()],
    }
    done(guard(scope, receive, send))
    return got[0]


async def inside(scope, receive, send):
    """An application that answers with what it was sent."""
    taken, message = 0, {}
    while message.get("type") != "http.disconnect":
        message = await receive()
        taken += len(message.get("body", b""))
    await send({"status": 200, "type": "http.response.start", "taken": taken})


HERE = {"host": "127.0.0.1:8650"}


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        (HERE, 200),
        ({"host": "localhost:8650"}, 200),
        ({"host": "[::1]:8650"}, 200),
        (HERE | {"origin": "http://127.0.0.1:8650"}, 200),
        ({"host": "evil.example"}, 403),  # a name made to lead here (DNS rebinding)
        ({}, 403),
        (HERE | {"origin": "https://evil.example"}, 403),
        (HERE | {"origin": "null"}, 403),  # what a sandboxed report would send
        (HERE | {"content-length": "1001"}, 413),
    ],
)
def test_on_this_machine_other_sites_are_refused(headers, status):
    guard = Guard(inside, token=None, local=True, most=1000)
    assert answer(guard, headers)["status"] == status


def test_a_socket_of_another_site_is_closed():
    guard = Guard(inside, token=None, local=True, most=1000)
    headers = HERE | {"origin": "https://evil.example"}
    assert answer(guard, headers, kind="websocket")["type"] == "websocket.close"


def test_what_says_no_length_is_cut_off_all_the_same():
    guard = Guard(inside, token=None, local=True, most=1000)
    assert answer(guard, HERE, body=[b"1" * 600] * 5)["taken"] == 600


def test_elsewhere_a_token_is_asked_for_once_then_a_cookie():
    guard = Guard(inside, token="secret", local=False, most=1000)
    host = {"host": "lab.example:8650"}
    assert answer(guard, host)["status"] == 401
    assert answer(guard, host, "token=wrong")["status"] == 401
    assert answer(guard, host | {"cookie": "softnn_token=wrong"})["status"] == 401
    welcome = answer(guard, host, "token=secret")
    assert welcome["status"] == 303
    said = dict(welcome["headers"])
    assert said[b"location"] == b"/results"  # the token leaves the address
    assert b"HttpOnly" in said[b"set-cookie"]
    cookie = said[b"set-cookie"].decode().partition(";")[0]
    assert answer(guard, host | {"cookie": cookie})["status"] == 200


# -- the command -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--port", "0"], "--port is 0; allowed is 1 to 65535"),
        (["--max-mb", "0"], "--max-mb is 0"),
        (["--host", "192.0.2.1"], "give another --port"),
    ],
)
def test_the_command_refuses_in_one_line(tmp_path, capsys, given, said):
    assert main(["app", "--out", str(tmp_path), *given]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


# -- processes -------------------------------------------------------------------------


def ended(runs, project, what="diagnose", within_s=120):
    until = time.monotonic() + within_s
    while "ended" not in (state := runs.state(project, what)):
        assert time.monotonic() < until, state
        time.sleep(0.1)
    return state


@pytest.fixture
def runs():
    one = Runs()
    yield one
    one.close()


def filled(out, folder):
    project = projects.new(out)
    for file in sorted((folder / "recordings").iterdir())[:2]:
        project.place_of(file.name).write_bytes(file.read_bytes())
    return project


@pytest.mark.slow
def test_a_run_cancelled_is_gone_with_all_it_wrote(tmp_path, runs):
    project = filled(tmp_path, write_case(tmp_path / "case"))
    runs.start(project, "diagnose")
    with pytest.raises(InputError, match="running already"):
        runs.start(project, "diagnose")
    (run,) = runs._all
    until = time.monotonic() + 60
    while "diagnosing" not in runs.state(project, "diagnose").get("stage", ""):
        assert time.monotonic() < until
        time.sleep(0.05)
    runs.cancel(project, "diagnose")
    assert runs.state(project, "diagnose")["ended"] == "cancelled"
    with pytest.raises(ProcessLookupError):
        os.killpg(run.pid, 0)
    assert project.result is None
    runs.start(project, "diagnose")  # and it can begin again
    runs.cancel(project, "diagnose")


@pytest.mark.slow
def test_a_run_whose_server_is_gone_ends_and_says_so_later(tmp_path, runs):
    project = filled(tmp_path, write_case(tmp_path / "case"))
    runs.start(project, "diagnose")
    (run,) = runs._all
    run.stdin.close()  # as when the server is killed
    assert run.wait(30) != 0
    state = Runs().state(project, "diagnose")
    assert state["ended"] == "failed"
    assert "stopped before its end" in state["line"]


@pytest.mark.slow
def test_a_file_that_cannot_be_diagnosed_ends_the_run_in_one_line(tmp_path, runs):
    project = projects.new(tmp_path)
    project.place_of("a.csv").write_text("time_s,strain,stress_MPa\n0,0,0\n")
    runs.start(project, "diagnose")
    state = ended(runs, project)
    assert state["ended"] == "failed"
    assert str(tmp_path) not in state["line"]
    assert "Traceback" not in json.dumps(state)
