"""Cards are read as codes read them, or refused in a line; written ones read back."""

import json

import numpy as np
import pytest
from made import MODULI

from softnn.cards.given import series_for
from softnn.cards.read import read_card, with_unit
from softnn.cards.written import ABAQUS, FEBIO, WRITERS
from softnn.cli import main
from softnn.contracts import Chunk, InputError
from softnn.fit import Guess
from softnn.model_file import Stored, from_dict, to_dict
from softnn.models.hyperelastic import LAWS, Hyper

STRAIN = np.array([-0.3, -0.1, 0.1, 0.5, 1.0])


def card(tmp_path, text, name="card.inp", **more):
    file = tmp_path / name
    file.write_text(text)
    return read_card(str(file), **more)


def stress(given):
    """Nominal stress before it relaxes, in the unit of the card."""
    return given.young * given.base().curve(STRAIN)


def abaqus(law, *more):
    return "\n".join(["*Material, name=m", *law, *more, ""])


def invariants(w1, w2=lambda i1, i2: 0.0):
    x = 1 + STRAIN
    i1, i2 = x**2 + 2 / x, 2 * x + 1 / x**2
    return 2 * (x - x**-2) * (w1(i1 - 3) + w2(i1, i2) / x)


def powers(*terms):
    """Abaqus's Ogden: the sum of 2 mu / alpha (...)."""
    x = 1 + STRAIN
    return sum(2 * mu / a * (x ** (a - 1) - x ** (-a / 2 - 1)) for mu, a in terms)


LONG = (
    # Keyword, lines, nominal stress. Treloar's rubber, Ogden 1972: mu_i alpha_i in
    # Ogden's form (0.63, 0.0012, -0.01 MPa; 1.3, 5, -2) are 2 mu / alpha in Abaqus's.
    ("*Hyperelastic, ogden, n=3",
     ["0.4095, 1.3, 0.003, 5., 0.01, -2., 0., 0.", "0."],
     lambda: powers((0.4095, 1.3), (0.003, 5), (0.01, -2))),
    ("*Hyperelastic, Mooney-Rivlin", ["0.162, 0.00589, 0."],
     lambda: invariants(lambda i: 0.162, lambda a, b: 0.00589)),
    ("*HYPERELASTIC,NEO HOOKE", ["0.27, 0."], lambda: invariants(lambda i: 0.27)),
    ("*Hyperelastic, Yeoh", ["0.363, -0.0251, 0.0023, 0.,0.,0."],
     lambda: invariants(lambda i: 0.363 - 2 * 0.0251 * i + 3 * 0.0023 * i**2)),
    ("*Hyperelastic, reduced polynomial, n=2", ["0.2, 0.01, 0., 0."],
     lambda: invariants(lambda i: 0.2 + 0.02 * i)),
    ("*Hyperelastic, n=1", ["0.1, 0.2, 0."],
     lambda: invariants(lambda i: 0.1, lambda a, b: 0.2)),
    ("*Hyperelastic, ogden", ["0.4, -3., 0."], lambda: powers((0.4, -3))),
    # Arruda and Boyce 1993: mu 0.27 MPa, 26.5 links a chain, Treloar's rubber.
    ("*Hyperelastic, Arruda-Boyce", [f"0.27, {26.5**0.5}, 0."],
     lambda: invariants(lambda i: 0.27 * sum(
         k * c * (i + 3) ** (k - 1) / 26.5 ** (k - 1) for k, c in enumerate(
             (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750), start=1)))),
)  # fmt: skip


@pytest.mark.parametrize(("keyword", "lines", "expected"), LONG)
def test_abaqus_laws_are_read_as_the_manual_has_them(
    keyword, lines, expected, tmp_path
):
    given = card(tmp_path, abaqus([keyword, *lines]))
    np.testing.assert_allclose(stress(given), expected(), rtol=1e-9)
    assert not given.shares


def test_a_foam_is_read(tmp_path):
    text = abaqus(["*Hyperfoam, n=2", "0.164, 8.88, 2.3e-5, -4.82, 0.1, 0.1"])
    x = 1 + STRAIN
    terms = ((0.164, 8.88), (2.3e-5, -4.82))
    expected = sum(2 * m / a * (x ** (a - 1) - x ** (-0.1 * a - 1)) for m, a in terms)
    np.testing.assert_allclose(stress(card(tmp_path, text)), expected, rtol=1e-9)
    one = card(tmp_path, abaqus(["*Hyperfoam, n=1", "0.164, 8.88, 0.1"]))
    m, a = terms[0]
    expected = 2 * m / a * (x ** (a - 1) - x ** (-0.1 * a - 1))
    np.testing.assert_allclose(stress(one), expected, rtol=1e-9)


def test_long_term_moduli_are_the_usual_ones_and_instantaneous_ones_are_asked(
    tmp_path,
):
    series = ["*Viscoelastic, time=PRONY", "0.3, 0., 0.5", "0.1, 0., 20."]
    hold = Chunk(np.array([0.0, 1e9]), np.array([0.5, 0.5]))
    for moduli, lasting, first in (
        ("", 1.0, 1 / 0.6),
        (", moduli=long term", 1.0, 1 / 0.6),
        (", MODULI=INSTANTANEOUS", 0.6, 1.0),
    ):
        law = [f"*Hyperelastic, neo hooke{moduli}", "0.5, 0."]
        model = card(tmp_path, abaqus(law, *series)).stored("MPa")
        found = model.stress(["a"], [hold], [None])[0]
        expected = 1.5 - 1.5**-2  # 2 C10 (l - 1 / l^2)
        np.testing.assert_allclose(found, [first * expected, lasting * expected])


def test_relaxation_data_become_a_series(tmp_path):
    time = np.geomspace(0.1, 100, 13)
    modulus = 1 - 0.3 * -np.expm1(-time / 1.0) - 0.2 * -np.expm1(-time / 31.6)
    rows = [f"{g:.6f}, {t:.6g}" for g, t in zip(modulus, time, strict=True)]
    law = ["*Hyperelastic, neo hooke, moduli=instantaneous", "0.5, 0."]
    text = abaqus(
        law, "*Viscoelastic, time=RELAXATION TEST DATA", "*Shear Test Data", *rows
    )
    given = card(tmp_path, text)
    shares, times = np.array(given.shares), np.array(given.times_s)
    ours = 1 - (-np.expm1(-time[:, None] / times)) @ shares
    np.testing.assert_allclose(ours, modulus, atol=5e-3)
    assert "Prony terms for the relaxation data" in given.notes[0]
    with pytest.raises(InputError, match="above 0 to 1"):
        series_for(np.array([1.0, 2.0]), np.array([1.2, 0.5]))


def test_ansys_laws_are_those_of_abaqus(tmp_path):
    text = """! stresses in MPa
MATID=7
TB,HYPER,MATID,1,2,OGDEN
TBDATA,1,0.63,1.3,-0.01,-2,0,0
TB,PRONY,7,1,1,SHEAR
TBDATA,1,0.2,5
TB,CDM,MATID,1,3,PSE2
TBDATA,1,1.5,0.02,0.1
"""
    given = card(tmp_path, text, "a.mac")
    np.testing.assert_allclose(stress(given), powers((0.4095, 1.3), (0.01, -2)))
    assert (given.unit, given.shares, given.mullins) == (
        "MPa",
        (0.2,),
        (1.5, 0.02, 0.1),
    )
    gent = card(tmp_path, "TB,HYPER,1,1,3,GENT\nTBDATA,1,0.3,80,0\n", "g.mac")
    expected = invariants(lambda i: 0.15 / (1 - i / 80))
    np.testing.assert_allclose(stress(gent), expected, rtol=1e-9)


FEB = """<?xml version="1.0"?><febio_spec version="4.0"><Module type="solid"
 units="mm-N-s"/><Material><material id="1" name="m" type="uncoupled viscoelastic">
<g1>0.5</g1><t1>2</t1><elastic type="Mooney-Rivlin"><c1>0.2</c1><c2>0.05</c2>
<k>500</k></elastic></material></Material></febio_spec>"""


def test_febio_shares_are_over_the_lasting_moduli(tmp_path):
    given = card(tmp_path, FEB, "a.feb")
    assert given.shares == pytest.approx((1 / 3,))
    lasting = invariants(lambda i: 0.2, lambda a, b: 0.05)
    np.testing.assert_allclose(stress(given), 1.5 * lasting, rtol=1e-9)
    assert given.unit == "MPa"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.inp", "*Material, name=m\n*Elastic\n2., 0.3\n", "no *HYPERELASTIC"),
        ("a.inp", abaqus(["*Hyperelastic, marlow", "0.1, 0.1"]), "not with MARLOW"),
        ("a.inp", abaqus(["*Hyperelastic, ogden, n=4", "1,2,1,2,1,2,1,2"]), "N=3"),
        ("a.inp", abaqus(["*Hyperelastic, yeoh", "0.5, x, 0"]), "'x' is no number"),
        ("a.inp", abaqus(["*Hyperelastic, neo hooke", "0.5, 0.", "0.4, 0., 60."]),
         "more than one temperature"),
        ("a.inp", abaqus(["*Hyperelastic, neo hooke", "0.5, 0."], "*Plastic", "1., 0."),
         "*PLASTIC changes the stress"),
        ("a.inp", abaqus(["*Hyperelastic, neo hooke", "0.5, 0."],
                         "*Viscoelastic, time=PRONY", "0.7,,1.", "0.5,,2."), "below 1"),
        ("a.inp", abaqus(["*Hyperelastic, neo hooke", "-0.5, 0."]), "modulus of -3"),
        ("a.inp", "*INCLUDE, INPUT=/etc/passwd\n", "no file in the folder"),
        ("a.inp", "*INCLUDE, INPUT=../b.inp\n", "no file in the folder"),
        ("a.inp", "*INCLUDE, INPUT=a.inp\n", "includes more than 8 files"),
        ("a.mac", "TB,HYPER,1,1,2,BLATZ\nTBDATA,1,1\n", "BLATZ"),
        ("a.mac", "TB,PLAS,1\n", "TB,PLAS changes the stress"),
        ("a.mac", "/EXIT\nSOLVE\n", "'SOLVE' is no command"),
        ("a.feb", '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><a>&x;</a>',
         "document type"),
        ("a.feb", "<a><material type='neo-Hookean'><E>1</E><v>0.3</v>", "is no XML"),
        ("a.feb", FEB.replace("Mooney-Rivlin", "Holmes"), "'Holmes' is not read"),
        ("a.feb", "\0\0", "is no text file"),
    ],
)  # fmt: skip
def test_what_is_not_known_is_named_in_one_line(name, text, said, tmp_path):
    (tmp_path / "b.inp").write_text("x")
    inner = tmp_path / "cards"
    inner.mkdir()
    with pytest.raises(InputError) as error:
        card(inner, text, name)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_an_included_file_beside_the_card_is_read(tmp_path):
    (tmp_path / "rubber.inc").write_text("*Hyperelastic, neo hooke\n0.5, 0.\n")
    given = card(tmp_path, "*Material, name=m\n*Include, input=rubber.inc\n")
    assert given.young == pytest.approx(3.0)


def test_one_of_several_materials_is_named(tmp_path):
    both = [f"*Material, name={n}\n*Hyperelastic, neo hooke\n{c}, 0.\n" for n, c in
            (("soft", 0.1), ("hard", 0.5))]  # fmt: skip
    with pytest.raises(InputError, match=r"card\.inp#soft"):
        card(tmp_path, "".join(both))
    given = read_card(f"{tmp_path / 'card.inp'}#hard")
    assert given.young == pytest.approx(3.0)


def test_a_unit_is_said_told_by_recordings_or_asked_for(tmp_path):
    law = ["*Hyperelastic, neo hooke", "5e5, 0."]
    plain = card(tmp_path, abaqus(law))
    assert card(tmp_path, "** stress in Pa\n" + abaqus(law)).unit == "Pa"
    assert card(tmp_path, abaqus(law), unit="kPa").unit == "kPa"
    measured = 1e-6 * stress(plain)
    told = with_unit(plain, STRAIN, 0.7 * measured)
    assert told.unit == "Pa"
    assert "no other unit comes near" in told.notes[-1]
    with pytest.raises(InputError, match="--card-unit"):
        with_unit(plain, STRAIN, 2.6e3 * measured)  # kPa and psi
    with pytest.raises(InputError, match="no unit of stress 'bar'"):
        card(tmp_path, abaqus(law), unit="bar")


# -- what is written -------------------------------------------------------------------

WRITTEN = MODULI | {"hyperfoam": (0.1, 8.0, 0.1, 0.02, -2.0, 0.1)}


def model_of(law, poisson=0.5):
    unit = LAWS[law].unit(WRITTEN[law])
    base = Hyper(
        f"{law}-prony", law, unit, (-0.3, 1.0), (0.5, 20.0), "uniaxial", poisson
    )
    told = to_dict(Guess(base, np.array([1.0, 0.3, 0.2])), [], "fresh", False)
    model = from_dict(told)
    assert isinstance(model, Stored)
    return model


@pytest.mark.parametrize("code", WRITERS)
@pytest.mark.parametrize("law", LAWS)
def test_a_card_reads_back_as_the_model(law, code, tmp_path):
    model = model_of(law, 0.1 if law == "hyperfoam" else 0.5)
    ending, write = WRITERS[code]
    lacks = {"abaqus": set(LAWS) - set(ABAQUS), "febio": set(LAWS) - set(FEBIO)}
    if law in lacks.get(code, ()):
        with pytest.raises(InputError, match=law):
            write(model, "m")
        return
    given = card(tmp_path, write(model, "m"), f"a{ending}")
    assert given.unit == "MPa"
    time = np.linspace(0, 30, 200)
    chunk = Chunk(time, 0.6 * np.sin(time / 5))
    again, expected = (
        one.stress(["a"], [chunk], [None])[0] for one in (given.stored("MPa"), model)
    )
    np.testing.assert_allclose(again, expected, rtol=1e-6, atol=1e-9)


def test_a_compressible_law_carries_its_bulk_modulus(tmp_path):
    model = model_of("yeoh", 0.4)
    given = card(tmp_path, WRITERS["abaqus"][1](model, "m"))
    assert given.poisson == pytest.approx(0.4, rel=1e-6)


@pytest.mark.slow
def test_a_card_is_corrected_in_the_dialect_that_came_in(tmp_path, capsys):
    """A card of half the stiffness: refitted it is right, and reads back as such."""
    model = model_of("mooney-rivlin")
    folder = tmp_path / "case"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name, pace in (("a", 1.0), ("b", 6.0), ("c", 20.0)):
        time = np.linspace(0, 4 * pace, 161)
        strain = 0.8 * (1 - np.abs(time / (2 * pace) - 1))
        (found,) = model.stress(["a"], [Chunk(time, strain)], [None])
        found = found + 0.003 * rng.standard_normal(161)
        rows = np.column_stack([time, strain, found])
        head = {"header": "time_s,strain,stress_MPa", "comments": ""}
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", **head)
    file = tmp_path / "own.inp"
    series = ["*Viscoelastic, time=PRONY", "0.1, 0., 0.5", "0.1, 0., 20."]
    file.write_text(abaqus(["*Hyperelastic, mooney-rivlin", "0.05, 0.01, 0."], *series))
    out = tmp_path / "out"
    assert main(["diagnose", str(folder), "--model", str(file), "--refit",
                 "--out", str(out), "--jobs", "1"]) == 0  # fmt: skip
    result = json.loads((out / "case" / "diagnosis.json").read_text())["card"]
    assert result["nrmse"] > 0.3
    assert result["refitted_heldout_nrmse"] < 0.02
    assert "Your Mooney-Rivlin card with 2 Prony terms" in capsys.readouterr().out
    again = read_card(str(out / "case" / "card.inp")).stored("MPa")
    time = np.linspace(0, 30, 200)
    chunk = Chunk(time, 0.8 * np.sin(time / 10) ** 2)
    ours, truth = (m.stress(["a"], [chunk], [None])[0] for m in (again, model))
    np.testing.assert_allclose(ours, truth, atol=0.02 * truth.max())
