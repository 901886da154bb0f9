"""Machine files against tidy recordings nobody here made, and `softnn read`."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from readers_made import (
    BOTH,
    REFERENCE,
    assert_same,
)

from softnn.cli import main
from softnn.contracts import InputError
from softnn.mismatch.api import to_case
from softnn.readers import read
from softnn.readers.tidy import read_tidy

# -- against tidy recordings nobody here made


TIDY = [
    (
        "instron_bluehill/leap-tension-1_1.csv",
        "foam-tpe-tension-cyclic/tidy/leap_t1.csv",
        {"length_mm": 16.52, "width_mm": 9.92, "thickness_mm": 6.17},
    ),
    (
        "instron_bluehill/silicone_30a_20251029_145648_1.csv",
        "silicone30a-instron/tidy/bluehill_10cycles.csv",
        {"length_mm": 110, "width_mm": 30, "thickness_mm": 2.65},
    ),
    (
        "instron_wavematrix/Test1.steps.tracking.csv",
        "silicone30a-instron/tidy/wavematrix_e3000_10cycles.csv",
        {"length_mm": 110, "width_mm": 30, "thickness_mm": 2.65},
    ),
    (
        "instron_bluehill_zh/0d05_1d5_1.csv",
        "vhb4910-zhao/tidy/lu_0d05_1d5_1.csv",
        {"length_mm": 80, "area_mm2": 22},
    ),
    (
        "ta_dma850/shear_relaxation_raw.xls",
        "oca-shear-ladder/tidy/shear_relaxation_raw.csv",
        {"length_mm": 0.13, "area_mm2": 100},
    ),
    (
        "ta_trios/leap-comp-4.txt",
        "foam-tpe-compression-cyclic/tidy/leap_comp_4.csv",
        {"length_mm": 10.92, "diameter_mm": 7.71},
    ),
]


@pytest.fixture(scope="module")
def data() -> Path:
    folder = Path(os.environ.get("SOFTNN_DATA") or "absent")
    if not (folder / "machine-formats").is_dir():
        pytest.skip("SOFTNN_DATA has no machine-formats")
    return folder


@pytest.mark.parametrize(("raw", "tidy", "given"), TIDY, ids=[t[0] for t in TIDY])
def test_raw_gives_tidy_to_a_thousandth(
    raw: str, tidy: str, given: dict, data: Path
) -> None:
    (found,) = read(data / "machine-formats" / raw, **given)
    expected = read_tidy(data / tidy)
    block = len(found) // len(expected)  # the rheometer's tidy file holds means of 5
    for name, there in expected.columns.items():
        here = found.columns[name][: block * len(expected)].reshape(-1, block).mean(1)
        if "wavematrix" in tidy and name == "stress_MPa":
            here = here - here[0]  # its source shows stress from the first sample on
        off = np.max(np.abs(here - there)) / np.ptp(there) if np.ptp(there) else 0.0
        assert off < 1e-3, name


def test_every_machine_file_is_read_or_refused_with_the_way_out(data: Path) -> None:
    way_out = ("--", "name the", "export ")
    refusals = {}
    for file in sorted((data / "machine-formats").glob("*/*")):
        try:
            found = read(file, **BOTH)
        except InputError as error:
            refusals[file.name] = str(error)
            continue
        assert found
        assert found[0].log[0].arguments["dialect"] != "delimited table", file.name
    for message in refusals.values():
        assert any(word in message for word in way_out), message


# -- softnn read


def test_command_writes_what_it_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [
        str(REFERENCE / "bluehill_two_specimens.csv"),
        str(REFERENCE / "generic_psi.csv"),
    ]
    out = tmp_path / "out"
    assert (
        main(["read", *files, "--length", "20", "--area", "10", "--out", str(out)]) == 0
    )
    shown = capsys.readouterr().out
    for word in ("Instron Bluehill", "Force [kN]", "0 to 0.11", "0 to 4.125 MPa"):
        assert word in shown
    written = sorted(p.name for p in out.glob("*.csv") if p.name != "index.csv")
    assert written == [
        "bluehill_two_specimens-1.csv",
        "bluehill_two_specimens-2.csv",
        "generic_psi.csv",
    ]
    for name in written:
        assert_same(read_tidy(out / name))
        assert_same(read(out / name)[0])
        assert (out / name).with_suffix(".png").stat().st_size > 1000
    # Specimens of one file are specimens still, also when more is read into the folder.
    assert main(["read", files[1], "--area", "10", "--length", "20", "--specimen", "S9",
                 "--out", str(out)]) == 0  # fmt: skip
    case = to_case(out)
    assert case.specimen == {
        "bluehill_two_specimens-1": "1", "bluehill_two_specimens-2": "2",
        "generic_psi": "S9"}  # fmt: skip
    assert case.groups() == [(0,), (1,), (2,)]


def test_command_refuses_in_one_line_and_reads_the_rest(
    capsys: pytest.CaptureFixture[str],
) -> None:
    bad, good = REFERENCE / "bad_unknown_unit.csv", REFERENCE / "generic_psi.csv"
    assert main(["read", str(bad), str(good), "--area", "10", "--length", "20"]) == 2
    shown = capsys.readouterr()
    assert len(shown.err.strip().splitlines()) == 1
    assert "4.125 MPa" in shown.out
    assert main(["read", str(good), "--unit", "nonsense"]) == 2
    assert main(["read", str(good), "--length", "-3"]) == 2


def test_command_never_writes_outside_out(tmp_path: Path) -> None:
    raw = (REFERENCE / "generic_psi.csv").read_bytes()
    out = tmp_path / "deep" / "out"
    names = ["..", "a\\b;c$(x)", "...hidden", "\u5e94\u53d8"]
    for name in names:
        (tmp_path / f"{name}.csv").write_bytes(raw)
        assert main(["read", str(tmp_path / f"{name}.csv"), "--out", str(out)]) == 0
    files = [p for p in (tmp_path / "deep").rglob("*") if p.is_file()]
    assert all(p.parent == out for p in files)
    assert all(p.name.isascii() and p.name[0].isalnum() for p in files)
