"""Cards carry the numbers of the model, and say what they cannot carry."""

import numpy as np
import pytest
from export_made import network, piece

from softnn.contracts import InputError
from softnn.effects import effect
from softnn.export.files import export, stored_of
from softnn.fit import Piece
from softnn.model_file import Stored
from softnn.models import (
    StandardLinearSolid,
)
from softnn.models.units import Units


def card_model(**softening):
    units = Units("pl-wiechert", (0.0, 0.1, 0.3, 0.6), (0.5, 20.0))
    law = effect("mullins_softening")
    values = law.defaults() | softening
    pieces = (Piece(law, values, ()), piece(effect("slack")))
    own: tuple[dict, ...] = ({}, {"gap": {"r": 0.02}})
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
    assert "NOT CARRIED: slack (Slack)" in text
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
    assert "NOT CARRIED: slack (Slack)" in text


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
