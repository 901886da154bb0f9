"""Cards of hyperelastic laws are run by finite-element codes: felupe and CalculiX."""

import shutil
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("felupe", reason="no finite elements: pip install felupe")

import felupe as fem
from law_made import FoamStrip, LawStrip, calculix
from made import MODULI
from strip_made import parsed, pulled

from softnn.cards.given import Given
from softnn.cards.written import abaqus
from softnn.contracts import Chunk

pytestmark = pytest.mark.slow
ccx = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="no CalculiX: apt-get install calculix-ccx"
)

RUN = {k: m for k, m in MODULI.items() if k not in ("gent", "hyperfoam")}
FOAM = (0.1, 8.0, 0.2, 0.02, -2.0, 0.2)
SERIES = {"shares": (0.25, 0.15), "times_s": (0.4, 6.0)}


def programme(to, seconds, points=9):
    """Up, back, up again, a hold, and down to nothing."""
    corners = np.cumsum([0, 1, 0.7, 0.7, 3, 1]) * seconds
    at = [np.linspace(a, b, points)[1:] for a, b in pairwise(corners)]
    time = np.concatenate([[0.0], *at])
    return Chunk(time, np.interp(time, corners, np.array([0, 1, 0.3, 1, 1, 0]) * to))


def agree(found, wanted):
    assert np.max(np.abs(found - wanted)) < 0.01 * np.max(np.abs(wanted))


@pytest.mark.parametrize(("to", "seconds"), [(0.8, 1.0), (-0.4, 5.0)])
@pytest.mark.parametrize("law", RUN)
def test_an_element_of_a_card_answers_as_softnn_simulates(law, to, seconds):
    model = Given("abaqus", "m", law, RUN[law], **SERIES).stored("MPa", (-0.4, 0.8))
    chunk = programme(to, seconds)
    strip = LawStrip(abaqus(model, "m")).pulled(chunk.time_s, chunk.strain)
    agree(strip, model.stress([""], [chunk], [None])[0])


@pytest.mark.parametrize(("to", "seconds"), [(0.5, 1.0), (-0.5, 5.0)])
def test_an_element_of_a_foam_answers_as_softnn_simulates(to, seconds):
    given = Given("abaqus", "m", "hyperfoam", FOAM, poisson=0.2, **SERIES)
    model = given.stored("MPa", (-0.5, 0.5))
    chunk = programme(to, seconds)
    strip = FoamStrip(abaqus(model, "m")).pulled(chunk.time_s, chunk.strain)
    agree(strip, model.stress([""], [chunk], [None])[0])


def test_the_mullins_effect_of_a_card_is_that_of_felupe():
    softening = (2.0, 0.05, 0.2)
    given = Given("abaqus", "m", "neo-hooke", (0.3,), mullins=softening)
    model = given.stored("MPa", (0.0, 0.8))
    chunk = programme(0.8, 1.0, 21)
    card = parsed(abaqus(model, "m"))
    ((c10, _),) = card["*hyperelastic"][1]
    assert card["*mullins effect"][1][0] == pytest.approx(list(softening))
    field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(fem.Cube(n=2)), dim=3)])
    rubber = fem.OgdenRoxburgh(fem.NeoHooke(2 * c10), *card["*mullins effect"][1][0])
    solid = fem.SolidBodyNearlyIncompressible(rubber, field, bulk=5000)
    wanted = model.stress([""], [chunk], [None])[0]
    agree(pulled(field, solid, chunk.strain), wanted)
    plain = Given("abaqus", "m", "neo-hooke", (0.3,)).stored("MPa", (0.0, 0.8))
    softer = plain.stress([""], [chunk], [None])[0] - wanted
    assert softer.max() > 0.1 * wanted.max()


@ccx
@pytest.mark.parametrize("law", [x for x in RUN if x != "ogden3"])
def test_calculix_reads_a_card_as_written(law, tmp_path):
    """Its law before it relaxes: CalculiX passes over the series and says so.

    A Poisson ratio stands in the card, as CalculiX takes 0.475 for an incompressible
    law.
    """
    given = Given("abaqus", "m", law, RUN[law], 0.48, **SERIES)
    model = given.stored("MPa", (-0.3, 0.8))
    strain = np.array([0.2, 0.5, 0.8, 0.4, 0.0, -0.15, -0.3])
    found = calculix(tmp_path, abaqus(model, "m"), strain)
    agree(found, given.young * given.base().curve(strain))


@ccx
def test_calculix_reads_a_foam_as_written(tmp_path):
    given = Given("abaqus", "m", "hyperfoam", FOAM, poisson=0.2)
    model = given.stored("MPa", (-0.5, 0.5))
    strain = np.array([0.2, 0.5, 0.0, -0.2, -0.5])
    found = calculix(tmp_path, abaqus(model, "m"), strain)
    agree(found, given.young * given.base().curve(strain))


def test_a_bonded_body_of_a_card_relaxes_as_its_series_says():
    """In an uneven field too: at a hold the force falls as the series does."""
    given = Given("abaqus", "m", "yeoh", RUN["yeoh"], **SERIES)
    text = abaqus(given.stored("MPa", (-0.2, 0.6)), "m")
    ramp = np.linspace(0.0, 0.4, 9)
    time = np.concatenate([1e-6 * ramp, np.geomspace(0.1, 60.0, 6)])
    strain = np.concatenate([ramp, np.full(6, 0.4)])
    force = LawStrip(text).bonded(time, strain, cells=2)[8:]
    fall = 1 - np.sum(
        np.array(SERIES["shares"])
        * -np.expm1(-time[8:, None] / np.array(SERIES["times_s"])),
        axis=1,
    )
    np.testing.assert_allclose(force / force[0], fall, rtol=0.01)
    free = given.young * given.base().curve(np.array([0.4]))
    assert force[0] > 1.02 * free[0]  # its ends hold it


@ccx
def test_two_codes_agree_on_a_bonded_body_of_a_card(tmp_path):
    given = Given("abaqus", "m", "mooney-rivlin", RUN["mooney-rivlin"], 0.48)
    text = abaqus(given.stored("MPa", (-0.2, 0.6)), "m")
    strain = np.array([0.2, 0.5, 0.2, -0.2])
    body = LawStrip(text)
    body.bulk = 2 / body.moduli[2]
    ours = body.bonded(np.arange(4.0), strain, cells=3, mean=False)
    agree(calculix(tmp_path, text, strain, cells=3, bonded=True), ours)
