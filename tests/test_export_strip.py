"""Cards are run: a strip of finite elements answers as the exported model does."""

import numpy as np
import pytest

pytest.importorskip("felupe", reason="no finite elements: pip install felupe")

import felupe as fem
from strip_made import Strip, parsed, pulled

from softnn.cards.loss import card_stress, loss
from softnn.cards.written import Card, card
from softnn.contracts import Chunk
from softnn.export.files import export, stored_of
from softnn.model_file import Stored
from softnn.models import StandardLinearSolid
from softnn.models.units import Units

pytestmark = pytest.mark.slow

SLS = {"equilibrium_stiffness": 3.0, "stiffness": 1.0, "relaxation_time": 2.0}


def stored(units, stiffness, pieces=()):
    own = tuple({} for _ in pieces)
    return Stored(units, np.array(stiffness), tuple(pieces), own, False, "fresh")


def spring():
    return stored(Units("pl-sls", (0.0, 0.1, 0.3, 0.6), ()), [6.0, 5.0, 7.0])


def solid():
    return stored_of(StandardLinearSolid(), SLS)


def branched():
    """A spring that is nearly straight, beside two branches."""
    units = Units("pl-wiechert", (0.0, 0.2, 0.5), (0.5, 5.0))
    return stored(units, [4.0, 4.1, 0.6, 0.5])


def cycles(to, seconds):
    """Up, most of the way back, up again, and a hold of ten ramps."""
    corners = np.cumsum([0, 1, 0.8, 0.8]) * seconds
    ramps = np.linspace(0, corners[-1], 27)
    hold = corners[-1] + np.geomspace(0.05, 10, 12) * seconds
    time = np.concatenate([ramps, hold])
    return Chunk(time, np.interp(time, corners, np.array([0, 1, 0.2, 1]) * to))


@pytest.mark.parametrize(
    ("model", "to", "seconds"),
    [(spring, 0.55, 1.0), (solid, 0.3, 4.0), (solid, 0.1, 0.2), (branched, 0.2, 2.0)],
)
def test_a_strip_of_the_card_answers_as_the_exported_model(model, to, seconds):
    model = model()
    chunk = cycles(to, seconds)
    text = export(model, "abaqus", "strip")["strip.inp"].decode()
    strip = Strip(text).pulled(chunk.time_s, chunk.strain)
    (wanted,) = model.stress([""], [chunk], [None])
    assert np.max(np.abs(strip - wanted)) < 0.01 * wanted.max()


def test_what_softnn_says_of_a_card_is_what_a_strip_of_it_does():
    # Branches beside a spring that stiffens: the card is far off, and it is said so.
    units = Units("pl-wiechert", (0.0, 0.1, 0.4), (0.5, 5.0))
    model = stored(units, [1.0, 9.0, 2.0, 1.0])
    chunk = cycles(0.35, 2.0)
    made = card(model)
    text = export(model, "abaqus", "strip")["strip.inp"].decode()
    strip = Strip(text).pulled(chunk.time_s, chunk.strain)
    said = card_stress(made, chunk)
    assert np.max(np.abs(strip - said)) < 0.01 * said.max()
    (wanted,) = model.stress([""], [chunk], [None])
    off = np.linalg.norm(strip - wanted) / np.linalg.norm(wanted)
    recording = type("R", (), {"name": "", "history": chunk})
    assert loss(model, made, [recording]).whole == pytest.approx(off, rel=0.05)


def test_the_softening_of_a_card_is_that_of_a_strip():
    """Ogden and Roxburgh as felupe has it, on a rubber of one constant."""
    shear, softening = 1.2, (2.5, 0.1, 0.3)
    stretch = np.linspace(0.7, 2, 400)
    curve = shear * (stretch - stretch**-2)
    none = np.zeros(0)
    made = Card(stretch - 1, curve, none, none, softening, 0.0, ())
    chunk = cycles(0.8, 1.0)
    mesh = fem.Cube(n=(3, 2, 2))
    field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
    rubber = fem.OgdenRoxburgh(fem.NeoHooke(shear), *softening)
    solid = fem.SolidBodyNearlyIncompressible(rubber, field, bulk=5000)
    strip = pulled(field, solid, chunk.strain)
    said = card_stress(made, chunk)
    assert np.ptp(strip[chunk.strain > 0.5]) > 0.1  # it softens
    assert np.max(np.abs(strip - said)) < 0.01 * said.max()


def test_shares_of_a_fluid_leave_the_strip_something_that_lasts():
    units = Units("wiechert", (0.0, 1.0), (2.0,))
    model = stored(units, [0.0, 0.5])
    text = export(model, "abaqus", "fluid")["fluid.inp"].decode()
    (row,) = parsed(text)["*viscoelastic"][1]
    assert 0.99 < row[0] < 1
    assert "nan" not in text
    chunk = cycles(0.1, 0.4)
    strip = Strip(text).pulled(chunk.time_s, chunk.strain)
    (wanted,) = model.stress([""], [chunk], [None])
    assert np.max(np.abs(strip - wanted)) < 0.01 * wanted.max()
