"""The functions of the package: the same as the commands, and errors in one line."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from made import STIFFNESS, UNITS, histories, mullins, write_case

import softnn
from softnn.contracts import InputError
from softnn.fit import Guess
from softnn.mismatch.case import Case, in_order
from softnn.model_file import to_dict
from softnn.recording import Recording
from softnn.simulate import simulate
from softnn.virtual import tensile


def springs(count=2, name="r"):
    """Recordings of 2 MPa of stiffness, in white noise."""
    rng = np.random.default_rng(0)
    time = np.linspace(0, 30, 300)
    out = []
    for i in range(count):
        strain = (0.3 + 0.1 * i) * (1 - np.abs(time / 15 - 1))
        stress = 2 * strain + 0.005 * rng.standard_normal(300)
        out.append(Recording(time, strain, stress, name=f"{name}{i}"))
    return out


@pytest.mark.parametrize(
    ("module", "heavy"),
    [("softnn", {"numba", "scipy", "pandas"}), ("softnn.cli", {"numba", "scipy"})],
)
def test_what_is_heavy_is_imported_when_it_is_needed(module, heavy):
    code = f"import sys, {module}; print({heavy} & set(sys.modules))"
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert said.stdout.strip() == "set()"


def test_the_package_offers_its_api_and_nothing_misspelt():
    assert {"read", "diagnose", "load_model"} <= set(softnn.__all__)
    with pytest.raises(AttributeError, match="no attribute 'raed'"):
        softnn.raed  # noqa: B018


def test_a_virtual_recording_is_a_table_and_back():
    (first, *_) = tensile("NatPolR")
    again = Recording.from_frame(first.to_frame(), name=first.name)
    assert list(first.to_frame()) == list(first.columns)
    for column, values in first.columns.items():
        np.testing.assert_array_equal(getattr(again, column), values)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"strain": None}, "no such column; it has"),
        ({"strain": ["0", "one"]}, "sample 1: 'one' is not a number"),
        ({"time_s": [1, 0]}, "time goes backwards"),
        ({"stress_MPa": [np.nan, np.nan]}, "no number at all"),
    ],
)
def test_a_table_that_is_no_recording_is_refused(change, said):
    table = {"time_s": [0, 1], "strain": [0, 0.1], "stress_MPa": [0, 0.2]} | change
    frame = pd.DataFrame({k: v for k, v in table.items() if v is not None})
    with pytest.raises(InputError, match=said) as error:
        Recording.from_frame(frame, name="mine")
    assert str(error.value).startswith("mine")


def test_files_folders_and_cases_are_read_alike(tmp_path):
    case = write_case(tmp_path / "case")
    one = softnn.read(case / "recordings" / "r0.csv")
    folder = softnn.read(case / "recordings")
    whole = softnn.read(case)
    assert (
        [r.name for r in folder]
        == [r.name for r in whole]
        == list(f"r{i}" for i in range(5))
    )
    for a, b in zip(folder, whole, strict=True):
        np.testing.assert_array_equal(a.stress_MPa, b.stress_MPa)
    np.testing.assert_array_equal(one[0].strain, folder[0].strain)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no recordings"):
        softnn.read(tmp_path / "empty")
    with pytest.raises(InputError, match="no such"):
        softnn.read(tmp_path / "none.csv")


def test_the_order_of_fresh_recordings_says_nothing():
    there, back = (softnn.diagnose(x, "hooke") for x in (springs(), springs()[::-1]))
    assert [r.name for r in back.case.recordings] == ["r0", "r1"]
    for key in ("noise", "fit", "mismatch"):
        assert there.result[key] == back.result[key]


@pytest.mark.parametrize(
    ("history", "names"), [("fresh", ["r0", "r1"]), ("continued", ["r1", "r0"])]
)
def test_recordings_that_go_on_keep_their_order(history, names):
    turned = springs()[::-1]
    simulated = tuple(r.strain for r in turned)
    case = Case("c", tuple(turned), history=history, simulated_MPa=simulated)
    found = in_order(case)
    assert [r.name for r in found.recordings] == names
    for one, stress in zip(found.recordings, found.simulated_MPa, strict=True):
        assert stress is one.strain  # goes with its recording


def test_a_list_a_folder_and_a_case_have_one_diagnosis(tmp_path):
    folder = tmp_path / "plain"
    folder.mkdir()
    for one in springs():
        one.to_frame().to_csv(folder / f"{one.name}.csv", index=False)
    by_list = softnn.diagnose(springs(), "hooke")
    by_folder = softnn.diagnose(folder, "hooke")
    by_case = softnn.diagnose(by_list.case, "hooke")
    told = [d.result["fit"]["after"] for d in (by_list, by_folder, by_case)]
    assert told[0] == told[2]
    assert told[1] == pytest.approx(told[0], rel=1e-6)
    assert by_list.verdict == "nothing_missing"
    assert by_list.selected == []
    assert by_list.to_frame()["effect"].isna().sum() == 1  # the base
    assert set(by_list.probability) <= set(by_list.to_frame()["effect"].dropna())
    saved = by_list.save(tmp_path / "out")
    stored = softnn.load_model(saved / "model.json")
    given = springs()[1]
    np.testing.assert_allclose(
        stored.simulate(given), by_list.model.simulate(given), rtol=1e-12
    )
    # To within what 600 samples of the noise leave of a stiffness.
    np.testing.assert_allclose(stored.simulate(given), 2 * given.strain, atol=0.003)
    assert softnn.diagnose(springs(), saved / "model.json").verdict == (
        "nothing_missing"
    )


def test_a_stored_model_finds_values_of_its_own_by_name(tmp_path):
    guess = Guess(UNITS, STIFFNESS)
    data = to_dict(guess, [], "fresh", False)
    data["effects"] = [
        {
            "effect": "zero_offset",
            "form": "ZeroOffset",
            "values": {"offset_MPa": 0.0},
            "own": {"offset_MPa": {"tilted": 0.25}},
        }
    ]
    file = tmp_path / "model.json"
    file.write_text(json.dumps(data))
    stored = softnn.load_model(file)
    chunk = histories()[0]
    strain = np.array(chunk.strain)
    strain[40:43] = np.nan  # bridged, straight in time
    plain, tilted = (
        stored.simulate(Recording(chunk.time_s, strain, chunk.strain, name=n))
        for n in ("other", "tilted")
    )
    expected = simulate(UNITS, STIFFNESS, [], [chunk])[0]
    np.testing.assert_allclose(plain, expected, atol=1e-9)
    np.testing.assert_allclose(tilted, expected + 0.25, atol=1e-9)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"history": "old"}, "history is 'old'"),
        ({"specimen": {"x": "A"}}, "'x', which is no recording"),
        ({"model": "mawxell"}, "no model 'mawxell'"),
        ({"model": "none.json"}, "no such file"),
        ({"seed": -1}, "seed is -1"),
        ({"recordings": []}, "no recordings"),
        ({"recordings": [np.zeros(3)]}, "hold a ndarray"),
        ({"recordings": "nowhere"}, "no such folder"),
    ],
)
def test_what_cannot_be_diagnosed_is_refused(given, said):
    with pytest.raises(InputError, match=said):
        softnn.diagnose(**{"recordings": springs(1)} | given)


@pytest.mark.slow
def test_the_function_says_what_the_command_says(tmp_path):
    from softnn.cli import main

    case = write_case(tmp_path / "soft", [mullins()])
    assert main(["diagnose", str(case), "--out", str(tmp_path / "out")]) == 0
    told = json.loads((tmp_path / "out" / "soft" / "diagnosis.json").read_text())
    found = softnn.diagnose(case)
    assert found.selected == told["selected"] == ["mullins_softening"]
    assert found.probability["mullins_softening"] == pytest.approx(
        told["explanations"][0]["probability"]
    )
