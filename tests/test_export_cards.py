"""Cards carry the numbers of the model, and say what they cannot carry."""

import json

import numpy as np
import pytest
from export_made import network, piece

from softnn.cards.loss import loss
from softnn.cards.written import card
from softnn.cli import main
from softnn.contracts import InputError
from softnn.effects import effect
from softnn.export.files import export, stored_of
from softnn.fit import Piece
from softnn.model_file import Stored, read_model
from softnn.models import (
    StandardLinearSolid,
)
from softnn.models.units import Units


def card_model(**softening):
    units = Units("pl-wiechert", (0.0, 0.1, 0.3, 0.6), (0.5, 20.0))
    law = effect("mullins_softening")
    values = law.defaults() | softening
    hard = effect("nonlinear_elasticity")
    stiffer = Piece(hard, hard.defaults() | {"stiffening_MPa": 0.02}, ())
    pieces = (Piece(law, values, ()), stiffer, piece(effect("slack")))
    own: tuple[dict, ...] = ({}, {}, {"gap": {"r": 0.02}})
    stiffness = np.array([6.0, 5.0, 7.0, 0.8, 0.4])
    return Stored(units, stiffness, pieces, own, False, "fresh")


def rows_after(text, keyword):
    lines = text.splitlines()
    start = next(i for i, x in enumerate(lines) if x.lower().startswith(keyword)) + 1
    out = []
    for line in lines[start:]:
        if line.startswith("*"):
            break
        out.append([float(v) for v in line.split(",")])
    return np.array(out)


def test_abaqus_card_carries_the_curve_the_series_and_the_softening():
    model = card_model(depth=0.4, scale=0.3, sharpness=0.7)
    text = export(model, "abaqus", "Foam 3*")["foam_3.inp"].decode()
    curve = rows_after(text, "*uniaxial")
    # Instantaneous: the springs' own curve and 1.2 MPa of branches.
    strain = curve[:, 1]
    springs = np.interp(strain, (0, 0.1, 0.3, 0.6), (0, 0.6, 1.6, 3.7))
    np.testing.assert_allclose(curve[:, 0], springs + 1.2 * strain, rtol=1e-8)
    series = rows_after(text, "*viscoelastic")
    np.testing.assert_allclose(series[:, 2], (0.5, 20.0))
    assert series[0, 0] / series[1, 0] == pytest.approx(2, rel=1e-8)
    # Relaxed, the curve is that of the springs, as near as one factor can bring it.
    kept = 1 - series[:, 0].sum()
    off = np.max(np.abs(kept * curve[:, 0] - springs)) / springs.max()
    assert off < 0.02
    assert f"off by up to {100 * off:.3g} %" in text
    (softening,) = rows_after(text, "*mullins")
    # Energy up to 0.3: the trapezia of the springs and half of 1.2 x 0.3 squared.
    energy = 0.6 * 0.1 / 2 + (0.6 + 1.6) / 2 * 0.2 + 0.6 * 0.3**2
    assert softening == pytest.approx([1 / 0.4, 0.7 * energy, 0.7], rel=1e-2)
    assert "NOT CARRIED: nonlinear_elasticity (NonlinearElasticity)" in text
    assert "of the test, not of the material: slack" in text
    assert "*Material, name=foam_3\n" in text


def test_ansys_card_says_the_same():
    model = card_model(depth=0.4, scale=0.3, sharpness=0.7)
    text = export(model, "ansys", "a")["a.mac"].decode()
    points = [x.split(",")[2:] for x in text.splitlines() if x.startswith("TBPT")]
    inp = export(model, "abaqus", "a")["a.inp"].decode()
    curve = rows_after(inp, "*uniaxial")
    np.testing.assert_allclose(np.array(points, float), curve[:, ::-1], rtol=1e-8)
    assert "TB,PRONY,MATID,1,2,SHEAR" in text
    assert "TB,CDM,MATID,1,3,PSE2" in text
    assert "NOT CARRIED: nonlinear_elasticity (NonlinearElasticity)" in text


def test_a_card_of_one_straight_spring_relaxes_exactly():
    model = stored_of(
        StandardLinearSolid(),
        {"equilibrium_stiffness": 3.0, "stiffness": 1.0, "relaxation_time": 2.0},
    )
    text = export(model, "abaqus", "a")["a.inp"].decode()
    assert rows_after(text, "*viscoelastic")[0] == pytest.approx([0.25, 0, 2.0])
    assert "off by up to" in text
    assert "Mullins" not in text


def test_a_network_has_no_card():
    with pytest.raises(InputError, match="no material card"):
        export(network(), "ansys", "a")


def stored_card(path, **softening):
    """The model above as a file."""
    model = card_model(**softening)
    effects = [
        {
            "effect": one.effect.id,
            "form": one.effect.form,
            "values": {k: float(np.ravel(v)[0]) for k, v in one.values.items()},
            "own": own,
        }
        for one, own in zip(model.pieces, model.own, strict=True)
    ]
    base = {
        "name": model.units.name,
        "knots": list(model.units.knots),
        "relaxation_times_s": list(model.units.relaxation_times),
        "stiffness_MPa": model.stiffness.tolist(),
    }
    content = {
        "kind": "softnn-model",
        "version": 1,
        "history": "fresh",
        "base": base,
        "effects": effects,
    }
    path.write_text(json.dumps(content))
    return path


def exported(path, out, *more):
    return main(["export", str(path), "--to", "abaqus", "--out", str(out), *more])


def test_the_command_says_what_a_card_lacks_and_how_much_that_is(tmp_path, capsys):
    file = stored_card(tmp_path / "m.json", depth=0.05, scale=0.3, sharpness=0.7)
    out = tmp_path / "out"
    assert exported(file, out) == 0
    told = capsys.readouterr()
    assert told.out == f"{out / 'm.inp'}\n"
    assert "off the model's, over cycles to a strain of 0.6" in told.err
    assert "not carried: nonlinear_elasticity (NonlinearElasticity)" in told.err
    assert "so not in the card: slack" in told.err


def test_a_card_far_off_is_refused_until_it_is_wanted_anyway(tmp_path, capsys):
    file = stored_card(tmp_path / "m.json", depth=0.05, scale=0.3, sharpness=0.7)
    content = json.loads(file.read_text())
    content["effects"][2]["values"]["gap"] = 0.1  # of the test: no card has it
    file.write_text(json.dumps(content))
    out = tmp_path / "out"
    assert exported(file, tmp_path / "slack") == 0
    content["effects"][1]["values"]["stiffening_MPa"] = 5.0
    file.write_text(json.dumps(content))
    capsys.readouterr()
    assert exported(file, out) == 2
    error = capsys.readouterr().err
    assert not out.exists()
    assert error.count("\n") == 1
    assert "nonlinear_elasticity" in error
    found = loss(read_model(file), card(read_model(file)))
    assert f"{100 * found.whole:.2g} % off" in error
    assert dict(found.of)["nonlinear_elasticity"] > 0.1
    assert exported(file, out, "--anyway") == 0
    assert (out / "m.inp").exists()


def test_a_card_is_compared_over_the_recordings_that_are_given(tmp_path, capsys):
    """A stiffening with the third power matters at a strain of 0.6, not at 0.05."""
    file = stored_card(tmp_path / "m.json", depth=0.05, scale=0.3, sharpness=0.7)
    content = json.loads(file.read_text())
    content["effects"][1]["values"]["stiffening_MPa"] = 5.0
    file.write_text(json.dumps(content))
    time = np.linspace(0, 20, 201)
    for name, high in (("small", 0.05), ("large", 0.6)):
        strain = high * (1 - np.abs(time / 10 - 1))
        rows = np.column_stack([time, strain, strain])
        np.savetxt(
            tmp_path / f"{name}.csv",
            rows,
            delimiter=",",
            header="time_s,strain,stress_MPa",
            comments="",
        )
    small, large = (str(tmp_path / f"{n}.csv") for n in ("small", "large"))
    assert exported(file, tmp_path / "a", "--recordings", large) == 2
    assert "over 1 recording;" in capsys.readouterr().err
    assert exported(file, tmp_path / "b", "--recordings", small) == 0


def test_a_card_has_the_scale_of_a_new_recording():
    units = Units("pl-sls", (-0.6, -0.3, 0.0), (2.0,))
    law = effect("gain_error")
    pieces = (Piece(law, {"error": 0.25}, ()),)
    own = ({"error": {"a": 0.0, "b": 0.5}},)
    model = Stored(units, np.array([6.0, 5.0, 0.8]), pieces, own, False, "fresh")
    plain = Stored(units, np.array([6.0, 5.0, 0.8]), (), (), False, "fresh")
    made = card(model)
    assert not made.missing
    assert not made.of_test
    np.testing.assert_allclose(made.stress_MPa, 1.25 * card(plain).stress_MPa)
    assert loss(model, made).whole == pytest.approx(loss(plain, card(plain)).whole)
    assert "strain of -0.6" in loss(model, made).over


def test_a_spring_alone_has_a_card_that_is_the_model():
    units = Units("pl-sls", (0.0, 0.1, 0.3, 0.6), ())
    model = Stored(units, np.array([6.0, 5.0, 7.0]), (), (), False, "fresh")
    assert loss(model, card(model)).whole < 1e-9


def test_the_curve_is_said_to_be_the_one_before_anything_relaxes():
    text = export(card_model(), "abaqus", "a")["a.inp"].decode()
    assert "*Hyperelastic, marlow, moduli=INSTANTANEOUS\n" in text
