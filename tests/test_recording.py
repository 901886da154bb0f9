"""Recording, tidy CSV, folders: what goes in comes out, and bad input is one line."""

import numpy as np
import pandas as pd
import pytest

from softnn.contracts import InputError
from softnn.readers import tidy
from softnn.recording import Geometry, Recording, data_hash

GOOD = "time_s,strain,stress_MPa\n0,0,0\n1,0.1,0.2\n2,0.2,\n"


def write(tmp_path, text, name="r.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_tidy_file_is_read_as_pandas_reads_it(tmp_path):
    path = write(tmp_path, GOOD.replace("MPa", "MPa,temperature_C,note").replace(
        "0,0,0\n", "0,0,0,23,x\n"))  # fmt: skip
    recording = tidy.read_tidy(path)
    frame = pd.read_csv(path)
    for name, values in recording.columns.items():
        np.testing.assert_array_equal(values, frame[name])
    assert recording.name == "r"
    assert np.isnan(recording.stress_MPa[2])


BAD = {
    "missing column": (
        "time_s,strain,stress\n0,0,0\n1,1,1\n",
        r"r\.csv, row 1, column 'stress_MPa': no such column",
    ),
    "text": (GOOD + "3,abc,1\n", r"row 5, column 'strain': 'abc' is not a number"),
    "decimal comma": (
        GOOD + '3,"0,3",1\n',
        r"row 5, column 'strain': '0,3' is not a number; a decimal comma",
    ),
    "backwards": (GOOD + "1,0,0\n", r"row 5, column 'time_s': time goes backwards"),
    "no rows": ("time_s,strain,stress_MPa\n", "no rows"),
    "empty": ("", "no rows; the file is empty"),
    "blank": ("\n\n", "no rows; the file is empty"),
    "one row": ("time_s,strain,stress_MPa\n0,0,0\n", "one row; at least two"),
    "not UTF-8": (
        GOOD.encode() + b"3,0.3\xe9,1\n",
        r"row 5: byte 0xe9 is not UTF-8; for a testing machine's own file",
    ),
    "all NaN": (
        "time_s,strain,stress_MPa\n0,0,\n1,0.1,\n",
        r"column 'stress_MPa': holds no number at all",
    ),
    "too many cells": (GOOD + "3,0,0,0\n", r"row 5: 4 values under 3 column names"),
    "infinite": (GOOD + "3,inf,1\n", r"row 5, column 'strain': infinite value"),
    "no time": (GOOD + ",0.3,1\n", r"row 5, column 'time_s': no time"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_give_one_clear_line(tmp_path, case):
    text, match = BAD[case]
    with pytest.raises(InputError, match=match) as caught:
        tidy.read_tidy(write(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_no_such_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        tidy.read_tidy(tmp_path / "absent.csv")


def test_a_folder_is_read_by_its_index(tmp_path):
    write(tmp_path, GOOD, "b.csv")
    write(tmp_path, GOOD, "a.csv")
    assert [r.name for r in tidy.read_folder(tmp_path)] == ["a", "b"]
    write(
        tmp_path,
        "file,material,test,rate_per_s,specimen\nb.csv,M,tensile,0.1,S1\na.csv,M,,,S2\n",
        "index.csv",
    )
    first, second = tidy.load(tmp_path)
    assert (first.name, first.material, first.test) == ("b", "M", "tensile")
    assert (first.rate_per_s, first.specimen) == (0.1, "S1")
    assert second.rate_per_s is None


@pytest.mark.parametrize(
    ("index", "match"),
    [
        ("name\nx\n", r"index\.csv, row 1, column 'file': no column 'file'"),
        ("file,rate_per_s\na.csv,fast\n", r"row 2, column 'rate_per_s': 'fast'"),
        ("file\n../a.csv\n", "lies outside the folder"),
        ("file\nnone.csv\n", "no such file"),
        ("file\n", "it lists no recording"),
    ],
)
def test_a_bad_index_gives_one_clear_line(tmp_path, index, match):
    write(tmp_path, GOOD, "a.csv")
    write(tmp_path, index, "index.csv")
    with pytest.raises(InputError, match=match):
        tidy.read_folder(tmp_path)


def test_an_unknown_set_names_those_that_are_there(tmp_path, monkeypatch):
    (tmp_path / "foam").mkdir()
    write(tmp_path / "foam", GOOD, "a.csv")
    write(tmp_path / "foam", "file\na.csv\n", "index.csv")
    monkeypatch.setenv("SOFTNN_DATA", str(tmp_path))
    assert len(tidy.load("foam")) == 1
    with pytest.raises(InputError, match="sets there: foam"):
        tidy.load("rubber")
    monkeypatch.setenv("SOFTNN_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="none; set SOFTNN_DATA"):
        tidy.load("foam")


def test_real_sets_are_read_as_their_index_says(data_folder):
    for name in ("vhb4910-zhao", "rubber-compression-relaxation"):
        index = pd.read_csv(data_folder / name / "index.csv")
        for recording, row in zip(tidy.load(name), index.itertuples(), strict=True):
            assert len(recording) == pytest.approx(row.n_points, abs=2)
            extreme = recording.strain[np.abs(recording.strain).argmax()]
            assert extreme == pytest.approx(row.max_strain, rel=2e-3)
            peak = recording.stress_MPa[np.abs(recording.stress_MPa).argmax()]
            assert peak == pytest.approx(row.peak_stress_MPa, rel=2e-3)


def test_geometry_gives_an_area_or_refuses():
    assert Geometry(width_mm=6, thickness_mm=1.5).area == 9
    assert Geometry(diameter_mm=2).area == pytest.approx(np.pi)
    assert Geometry(area_mm2=5, diameter_mm=2).area == 5
    assert Geometry().area is None
    with pytest.raises(InputError, match="length_mm is -33"):
        Geometry(length_mm=-33)


def test_a_recording_cannot_be_changed_from_outside():
    time = np.arange(3.0)
    recording = Recording(time, time, time)
    time[0] = 99
    assert recording.time_s[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        recording.strain[0] = 1


def test_the_hash_sees_every_channel_and_no_path():
    t = np.arange(3.0)
    one = Recording(t, t, t, name="a", source="/here")
    assert data_hash([one]) == data_hash([Recording(t, t, t, name="a")])
    assert data_hash([one]) != data_hash([Recording(t, t, t + 1e-12, name="a")])
    assert data_hash([one]) != data_hash([Recording(t, t, t, t, name="a")])
