"""Wrong units, signs and columns are met; recordings of soft materials are not."""

import numpy as np
import pandas as pd
import pytest
from made import STIFFNESS, UNITS, histories, mullins, write_case

from softnn.axes import COMPONENTS
from softnn.cli import main
from softnn.contracts import InputError
from softnn.effects import EFFECTS
from softnn.mismatch.api import to_case
from softnn.plausible import bent, check_plausible, scattered, understood
from softnn.readers.tidy import read_folder
from softnn.recording import Recording
from softnn.simulate import Term, simulate
from softnn.virtual import relaxation, tensile


def recorded(chunk=None, noise=0.002, effects=()):
    """A cycle of a viscoelastic material of some 1 MPa, with what is named in it."""
    chunk = chunk or histories()[1]
    stress = simulate(UNITS, STIFFNESS, list(effects), [chunk])[0]
    rng = np.random.default_rng(0)
    noisy = stress + noise * rng.standard_normal(len(stress))
    return chunk.time_s, chunk.strain, noisy


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda t, e, s: (t, -e, s), "sign reversed"),
        (lambda t, e, s: (t, e, -s), "sign reversed"),
        (lambda t, e, s: (t, s, e), "swapped"),
        (lambda t, e, s: (t, e, 1e3 * s), "kPa"),
        (lambda t, e, s: (t, e, 1e6 * s), "Pa"),
        (lambda t, e, s: (t, 100 * e, 0.03 * s), "per cent"),
        (lambda t, e, s: (t, e, 1e-4 * s), "GPa"),
        (lambda t, e, s: (t, e, 0 * s + 0.2), "throughout"),
    ],
)
def test_what_would_be_answered_wrongly_is_refused(wrong, said):
    time, strain, stress = wrong(*recorded())
    with pytest.raises(InputError, match=said) as error:
        check_plausible(Recording(time, strain, stress, name="mine"))
    assert "mine" in str(error.value)
    assert "--as-is" in str(error.value)


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (lambda t, e, s: (t, 100 * e, s), "per cent"),
        (lambda t, e, s: (1e3 * t, e, s), "ms"),
        (lambda t, e, s: (t / 120, e, s), "60 or 3600"),
        (lambda t, e, s: (t, e, 15 * s), "or a force?"),
        (lambda t, e, s: (t, e, s - 7), "offset"),
    ],
)
def test_what_may_be_right_is_noted(odd, said):
    time, strain, stress = odd(*recorded())
    (note,) = check_plausible(Recording(time, strain, stress, name="mine"))
    assert said in note


@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_no_effect_is_taken_for_a_mistake(law):
    """On its own telltale, in tension and of its default size."""
    terms = [Term(law, {p.name: p.default for p in law.parameters})]
    time, strain, stress = recorded(law.telltale(), effects=terms)
    check_plausible(Recording(time, strain, stress, name=law.id))


def test_compression_and_the_published_materials_are_plausible():
    time, strain, stress = recorded()
    assert check_plausible(Recording(time, -strain, -stress)) == []
    for one in (*tensile("NatPolR"), *relaxation("NatPolR")):
        check_plausible(one)


def test_real_recordings_of_rubber_are_plausible(data_folder):
    for name in (
        "vhb4910-zhao",
        "rubber-compression-relaxation",
        "cb-silicone-stretcher",
    ):
        for one in read_folder(data_folder / name):
            check_plausible(one)


def test_it_is_told_in_words_by_which_a_wrong_unit_shows():
    time = np.linspace(0, 7200, 721)
    strain = 0.25 * (1 - np.abs(time / 3600 - 1))
    said = understood(Recording(time, -strain, -4 * strain))
    assert said == (
        "120 min; strain down to -25 % at 0.0069 % a second; stress to -1 MPa: "
        "silicone or rubber"
    )
    for factor, kind in (
        (5e-3, "gel"),
        (0.05, "very soft"),
        (10, "hard"),
        (99, "tendon"),
        (999, "metal"),
    ):
        assert kind in understood(Recording(time, strain, 4 * factor * strain))
    force = Recording(time, 40 * strain, 90 * strain, axes=COMPONENTS[0])
    assert understood(force).endswith("elongation to 10 mm at 0.0028 mm/s; force to "
                                      "22.5 N")  # fmt: skip


def test_specimens_nobody_named_are_asked_for():
    """Of one programme; not where the programme differs, nor where noise does."""
    time, strain, stress = recorded()
    one = Recording(time, strain, stress, name="a")
    (note,) = scattered([one, Recording(time, strain, 1.2 * stress, name="b")])
    assert note.startswith("a, b: strained alike")
    assert "[specimen]" in note
    rng = np.random.default_rng(1)
    noisy = stress + 0.002 * rng.standard_normal(len(stress))
    assert scattered([one, Recording(time, strain, noisy, name="b")]) == []
    assert scattered([one, Recording(time, 0.5 * strain, stress / 2, name="b")]) == []
    assert scattered([one, Recording(2 * time, strain, 1.2 * stress, name="b")]) == []


def test_a_parabola_deviates_from_its_chords_as_geometry_says():
    """Over a stretch h of t^2: rms h^2 / (6 sqrt 5), whatever the stretch."""
    time = np.linspace(0, 1, 16_000)
    assert bent(time, time**2) == pytest.approx((1 / 16) ** 2 / (6 * 5**0.5), rel=1e-2)


def test_refused_by_the_command_unless_it_is_right(tmp_path, capsys):
    case = write_case(tmp_path / "case", [mullins()])
    for file in (case / "recordings").glob("*.csv"):
        frame = pd.read_csv(file)
        frame["stress_MPa"] *= 1000
        frame.to_csv(file, index=False)
    assert main(["diagnose", str(case), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "kPa" in told
    assert "r0" in told
    assert to_case(case, as_is=True).notes == ()


def test_simulate_refuses_strain_in_per_cent(tmp_path, capsys):
    import json

    from softnn.fit import Guess
    from softnn.model_file import to_dict

    model, file = tmp_path / "model.json", tmp_path / "r.csv"
    model.write_text(json.dumps(to_dict(Guess(UNITS, STIFFNESS), [], "fresh", False)))
    file.write_text("time_s,strain\n0,0\n1,10\n2,30\n")
    words = ["simulate", str(model), str(file), "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert "per cent" in capsys.readouterr().err
    assert main([*words, "--as-is"]) == 0
    assert "beyond 0 to 1" in capsys.readouterr().err
