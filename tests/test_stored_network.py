"""A trained network as a file, and as the simulation that a diagnosis corrects."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from softnn import cli
from softnn.contracts import Chunk, InputError
from softnn.model_file import Stored
from softnn.models.units import Units
from softnn.neural import (
    Network,
    Regularisation,
    Seen,
    StoredNetwork,
    samples,
    stored,
    train,
)
from softnn.recording import Recording


def pull(peak, seconds, n=400):
    time = np.linspace(0, seconds, n)
    strain = peak * (1 - np.abs(1 - 2 * time / seconds))
    return time, strain


PULLS = {"a": (0.4, 20.0), "b": (0.6, 10.0), "c": (0.5, 40.0), "d": (0.6, 30.0)}


def test_a_network_and_a_model_are_shown_in_short(network):
    model = replace(network, seen=Seen((0.0, 0.6), (0.0, 1.0)))
    assert len(repr(model)) < 200
    assert "at strains of 0 to 0.6" in repr(model)
    pressed = replace(network, seen=Seen((-0.4, 3e-5), (0.0, 1.0)))
    assert "at strains of -0.4 to 3e-05" in repr(pressed)
    assert model._repr_html_().count("<polyline") == 1
    units = Units("hooke", (0.0, 1.0))
    spring = Stored(units, np.array([2.0]), (), (), False, "fresh")
    assert repr(spring) == "<Model of stress: hooke; no effects>"
    assert spring._repr_html_().count("<polyline") == 1


def stress_of(strain):
    return 2 * strain + 3 * strain**2


@pytest.fixture(scope="module")
def network():
    recordings = [
        Recording(t, e, stress_of(e), name=n)
        for n, (t, e) in ((n, pull(*p)) for n, p in PULLS.items())
    ]
    known = samples(recordings, "FFRI1")
    one = train(
        known.inputs,
        known.target,
        neurons=[4],
        train_mask=np.ones((1, len(known.target)), bool),
        seeds=[0],
        regularisation=Regularisation.parse("bayesian"),
    )[0]
    return StoredNetwork(one.network, "FFRI1", known.lag_s)


@pytest.fixture
def case(tmp_path, network):
    """Recordings whose third and only third reads 0.1 MPa too much."""
    folder = tmp_path / "case"
    (folder / "recordings").mkdir(parents=True)
    rng = np.random.default_rng(3)
    for name, shape in PULLS.items():
        time, strain = pull(*shape)
        stress = stress_of(strain) + 0.01 * rng.standard_normal(len(time))
        table = {
            "time_s": time,
            "strain": strain,
            "stress_MPa": stress + 0.1 * (name == "c"),
        }
        pd.DataFrame(table).to_csv(folder / "recordings" / f"{name}.csv", index=False)
    file = tmp_path / "network.json"
    file.write_text(json.dumps(network.source))
    return folder, file


def test_file_gives_the_same_stress(network):
    back = stored.from_dict(json.loads(json.dumps(network.source)))
    time, strain = pull(0.55, 15.0)
    chunk = Chunk(time, strain)
    (stress,) = back.stress(["x"], [chunk], [None])
    np.testing.assert_array_equal(stress, network.stress(["x"], [chunk], [None])[0])
    np.testing.assert_allclose(stress, stress_of(strain), atol=0.02)


def test_network_is_a_base_and_its_correction_needs_no_column(case, tmp_path):
    folder, file = case
    out = tmp_path / "out"
    command = ["diagnose", str(folder), "--model", str(file), "--out", str(out)]
    assert cli.main(command) == 0
    told = json.loads((out / "case" / "diagnosis.json").read_text())
    assert told["selected"] == ["zero_offset"]
    value = told["explanations"][0]["parameters"]["offset_MPa of c"]["value"]
    assert value == pytest.approx(0.1, abs=0.01)
    # The corrected model holds the network: strain alone is enough to simulate.
    model = out / "case" / "model.json"
    recording = folder / "recordings" / "c.csv"
    assert cli.main(["simulate", str(model), str(recording), "--out", str(out)]) == 0
    table = pd.read_csv(out / "c.csv")
    wanted = stress_of(table["strain"]) + 0.1
    np.testing.assert_allclose(table["simulated_MPa"], wanted, atol=0.03)


def test_simulate_marks_and_counts_what_a_network_was_never_shown(
    network, tmp_path, capsys
):
    seen = Seen((0.0, 0.6), (-0.2, 0.2))
    file, recording = tmp_path / "network.json", tmp_path / "far.csv"
    file.write_text(json.dumps(replace(network, seen=seen).source))
    # 0.01 a sample up to 0.79, then as fast back: a rate of 1 per s is outside too.
    strain = np.concatenate([np.arange(0, 0.8, 0.01), [0.75, 0.7]])
    time = np.append(np.arange(80) * 0.1, [7.95, 8.0])
    pd.DataFrame({"time_s": time, "strain": strain}).to_csv(recording, index=False)
    out = str(tmp_path / "out")
    assert cli.main(["simulate", str(file), str(recording), "--out", out]) == 0
    flags = pd.read_csv(tmp_path / "out" / "far.csv")["outside"].to_numpy()
    assert np.flatnonzero(flags & 1).tolist() == list(range(61, 82))
    assert np.flatnonzero(flags & 2).tolist() == [80, 81]
    told = capsys.readouterr().out
    assert told.startswith(
        "far: 82 samples, 21 outside the training (strain 21, rate 2); written to "
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"architecture": "FFRI9"}, "FFRI1"),
        ({"architecture": "FFRD4"}, "2 inputs"),
        ({"version": 7}, "version 7"),
        ({"network": None}, "no network"),
        ({"lag_s": -1.0}, "above 0"),
    ],
)
def test_bad_file_is_refused_in_one_line(network, case, tmp_path, capsys, change, said):
    folder, file = case
    file.write_text(json.dumps(network.source | change))
    command = ["diagnose", str(folder), "--model", str(file), "--out", str(tmp_path)]
    assert cli.main(command) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert "network.json" in error
    assert "\n" not in error


def test_a_network_from_outside_is_checked():
    with pytest.raises(InputError, match="not a network"):
        Network.from_dict({"hidden": [[1.0]]})


def test_a_network_takes_times_and_strains_and_warns_beyond_its_training(network):
    model = replace(network, seen=Seen((0.0, 0.6), (0.0, 1.0)))
    time, strain = np.linspace(0, 1, 30), np.linspace(0, 0.5, 30)
    mine = Recording(time, strain, np.zeros(30))
    np.testing.assert_array_equal(model.simulate(time, strain), model.simulate(mine))
    with pytest.warns(UserWarning, match="never shown .*strain"):
        model.simulate(time, 4 * strain)
