"""Public recordings: fetched from a server on this machine, whole or not at all."""

import functools
import hashlib
import http.server
import os
import threading
from pathlib import Path
from urllib.parse import quote

import pytest

from softnn import datasets
from softnn.cli import main
from softnn.contracts import InputError
from softnn.readers import READERS, read
from softnn.readers.options import ReadOptions
from softnn.readers.tidy import load

REFERENCE = Path(__file__).parent / "reference"
ORIGINAL = REFERENCE / "bluehill_german.csv"


@pytest.fixture
def server(tmp_path):
    """A folder that is served, and its address; `short` cuts every answer."""
    root = tmp_path / "served"
    root.mkdir()

    class Quiet(http.server.SimpleHTTPRequestHandler):
        short = False

        def log_message(self, *_):
            pass

        def copyfile(self, source, outputfile):
            whole = source.read()
            outputfile.write(whole[: len(whole) // 2] if Quiet.short else whole)

    handler = functools.partial(Quiet, directory=str(root))
    served = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=served.serve_forever, args=(0.05,))
    thread.start()
    yield root, f"http://127.0.0.1:{served.server_port}", Quiet
    served.shutdown()
    thread.join()
    served.server_close()


@pytest.fixture
def own(server, tmp_path, monkeypatch):
    """A manifest of one set with a reference file, served; SOFTNN_DATA is empty."""
    root, address, handler = server
    path = root / "lab/rubber/abc/some folder/rubber 1.csv"
    path.parent.mkdir(parents=True)
    path.write_bytes(ORIGINAL.read_bytes())
    sha256 = hashlib.sha256(ORIGINAL.read_bytes()).hexdigest()
    manifest = tmp_path / "manifest.toml"
    manifest.write_text(
        '[rubber]\nmaterial = "a rubber"\nabout = "pulled"\nlicence = "CC0"\n'
        'repository = "lab/rubber"\ncommit = "abc"\n'
        '[[rubber.files]]\npath = "some folder/rubber 1.csv"\ntest = "tensile"\n'
        f'sha256 = "{sha256}"\nreader = "Instron Bluehill"\n'
        "options = { length_mm = 25.0, area_mm2 = 10.0 }\n"
    )
    monkeypatch.setattr(datasets, "MANIFEST", manifest)
    monkeypatch.setenv("SOFTNN_DATA", str(tmp_path / "data"))
    return path, address, handler


def test_a_fetched_set_is_what_the_reader_reads_of_the_original(own, capsys):
    _, address, _ = own
    assert main(["data", "fetch", "rubber", "--mirror", address]) == 0
    assert "licence: CC0" in capsys.readouterr().out
    (got,) = load("rubber")  # by name, as a study asks for it
    (meant,) = read(ORIGINAL, length_mm=25, area_mm2=10)
    assert got.stress_MPa == pytest.approx(meant.stress_MPa, rel=1e-8)
    assert (got.material, got.test) == ("a rubber", "tensile")
    assert main(["data", "verify"]) == 0
    assert "rubber: whole" in capsys.readouterr().out


def test_what_was_changed_since_is_told(own, capsys):
    _, address, _ = own
    folder = datasets.fetch("rubber", address)
    tidy = next((folder / "tidy").iterdir())
    tidy.write_text(tidy.read_text().replace("1", "2", 1))
    (folder / "original" / "rubber 1.csv").unlink()
    assert main(["data", "verify", "rubber"]) == 2
    told = capsys.readouterr().err
    assert "original/rubber 1.csv is missing" in told
    assert f"tidy/{tidy.name} is not as it was fetched" in told
    with pytest.raises(InputError, match="move it away"):
        datasets.fetch("rubber", address)


def test_a_set_that_is_whole_is_not_fetched_again(own):
    path, address, _ = own
    folder = datasets.fetch("rubber", address)
    path.unlink()
    assert datasets.fetch("rubber", address) == folder


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda path, handler: path.write_bytes(b"other"), "another SHA-256"),
        (lambda path, handler: path.unlink(), "answers 404"),
        (lambda path, handler: setattr(handler, "short", True), "nothing was kept"),
    ],
)
def test_what_does_not_come_whole_leaves_nothing(own, damage, said, capsys):
    path, address, handler = own
    damage(path, handler)
    assert main(["data", "fetch", "rubber", "--mirror", address]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    data = Path(os.environ["SOFTNN_DATA"])
    assert [p.name for p in data.iterdir() if not p.name.startswith(".rubber.")] == []
    assert not list(data.glob("*fetching*"))


def test_what_a_killed_fetch_left_goes_with_the_next(own):
    _, address, _ = own
    left = Path(os.environ["SOFTNN_DATA"]) / ".rubber.fetching-1"
    left.mkdir(parents=True)
    datasets.fetch("rubber", address)
    assert not left.exists()


def test_a_folder_of_somebody_else_is_left_alone(own):
    _, address, _ = own
    mine = Path(os.environ["SOFTNN_DATA"]) / "rubber"
    mine.mkdir(parents=True)
    (mine / "index.csv").write_text("mine")
    with pytest.raises(InputError, match="move it away"):
        datasets.fetch("rubber", address)
    assert (mine / "index.csv").read_text() == "mine"


def test_a_set_with_a_path_out_of_its_folder_is_not_believed(own):
    _, address, _ = own
    folder = datasets.fetch("rubber", address)
    told = folder / "source.json"
    told.write_text(told.read_text().replace('"index.csv"', '"../../x.csv"'))
    assert "outside the folder" in datasets.verify("rubber")[0]


def test_misspelt_and_by_hand(capsys):
    assert main(["data", "fetch", "vhb491"]) == 2
    assert "did you mean 'vhb4910'?" in capsys.readouterr().err
    assert main(["data", "fetch", "oring-seal"]) == 2
    assert "by hand from https://github.com/" in capsys.readouterr().err


@pytest.mark.parametrize("name", datasets.published())
def test_the_manifest_has_what_a_user_must_know(name, capsys):
    one = datasets.published_set(name)
    assert len(one.commit) == 40
    int(one.commit, 16)
    assert one.licence
    dialects = {dialect.NAME for dialect in READERS}
    for file in one.files:
        assert len(bytes.fromhex(file.sha256)) == 32
        assert file.reader in dialects
        ReadOptions(**file.options)
    assert main(["data", "show", name]) == 0
    assert one.address in capsys.readouterr().out


def test_the_manifest_agrees_with_files_at_hand(
    server, data_folder, tmp_path, monkeypatch
):
    """Whatever untouched exports lie at hand come through the whole way."""
    root, address, _ = server
    at_hand = {
        hashlib.sha256(p.read_bytes()).hexdigest(): p
        for p in (data_folder / "machine-formats").rglob("*")
        if p.is_file()
    }
    monkeypatch.setenv("SOFTNN_DATA", str(tmp_path / "data"))
    fetched = []
    for one in datasets.published().values():
        if not one.files or any(f.sha256 not in at_hand for f in one.files):
            continue
        for file in one.files:
            to = root / one.repository / one.commit / file.path
            to.parent.mkdir(parents=True, exist_ok=True)
            to.write_bytes(at_hand[file.sha256].read_bytes())
        assert quote(one.name) == one.name
        assert len(load(str(datasets.fetch(one.name, address)))) == len(one.files)
        assert datasets.verify(one.name) == []
        fetched.append(one.name)
    if not fetched:
        pytest.skip("no untouched exports at hand")
