"""Published cards are read right or refused in a line.

Parameters are typed into decks written here, as users have them. What they are checked
against are formulas of the literature, written out below: nominal stress in uniaxial
tension and compression, before it relaxes.

A published card says its moduli, often not how they are to be typed. Where a deck here
has an option that the source leaves open (MODULI, the unit, TEST DATA INPUT), it is
one that users write. Sources by short name:
  verification   Abaqus Verification Guide, Viscoelastic materials (2.2.2), materials
                 1 to 9
  guide          Ansys Mechanical APDL Structural Analysis Guide, 8.4.1 (hyperelastic
                 options and viscoelasticity)
  febio          FEBio User Manual, chapter on materials
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erf

from softnn.cards.read import read_card, with_unit
from softnn.contracts import Chunk, InputError

STRETCH = np.array([0.6, 0.8, 0.95, 1.1, 1.5, 2.0, 3.0])

# -- formulas --------------------------------------------------------------------------


def mooney(c1, c2=0.0):
    """Rivlin 1948; Treloar 1975, The Physics of Rubber Elasticity, chapter 5."""
    return lambda x: 2 * (x - x**-2) * (c1 + c2 / x)


def yeoh(c1, c2, c3):
    """Yeoh 1993, doi:10.5254/1.3538343."""

    def stress(x):
        i = x**2 + 2 / x - 3
        return 2 * (x - x**-2) * (c1 + 2 * c2 * i + 3 * c3 * i**2)

    return stress


def ogden(*terms):
    """Ogden 1972, doi:10.1098/rspa.1972.0026: the sum of mu (x^(a-1) - ...)."""
    return lambda x: sum(mu * (x ** (a - 1) - x ** (-a / 2 - 1)) for mu, a in terms)


def arruda_boyce(mu, links):
    """Arruda and Boyce 1993, doi:10.1016/0022-5096(93)90013-6: five terms."""

    def stress(x):
        i = x**2 + 2 / x
        slope = (
            1 / 2
            + i / (10 * links)
            + 11 * i**2 / (350 * links**2)
            + 19 * i**3 / (1750 * links**3)
            + 519 * i**4 / (134750 * links**4)
        )
        return 2 * mu * (x - x**-2) * slope

    return stress


def foam(beta, *terms):
    """Ogden 1972, doi:10.1098/rspa.1972.0096, one beta: sides are x^-nu."""
    nu = beta / (1 + 2 * beta)
    return lambda x: sum(mu * (x ** (a - 1) - x ** (-nu * a - 1)) for mu, a in terms)


def squeezable(c1, d):
    """Neo-Hooke with (J - 1)^2 / d; the sides are free of stress."""

    def principal(x, side):
        volume = x * side**2
        mean = (x**2 + 2 * side**2) / 3
        deviator = 2 * c1 * volume ** (-5 / 3)
        pressure = 2 / d * (volume - 1)
        return deviator * (x**2 - mean) + pressure, deviator * (
            side**2 - mean
        ) + pressure

    def stress(x):
        side = brentq(lambda s: principal(x, s)[1], 0.2, 3.0)
        return principal(x, side)[0] * side**2

    return np.vectorize(stress)


# -- the cards -------------------------------------------------------------------------


@dataclass(frozen=True)
class Published:
    """A card, where it is from, and what it says.

    `young` is three initial shear moduli before they relax, of a foam Young's modulus.
    """

    source: str
    name: str
    text: str
    stress: object
    young: float
    series: tuple = ()  # share and time of each term
    unit: str = ""
    poisson: float = 0.5
    curve: tuple = ()  # stretch and stress measured, within a tenth


def abaqus(*lines):
    return "\n".join(["*HEADING", "a job", "*MATERIAL, NAME=RUBBER", *lines, ""])


def prony(*terms):
    rows = [f" {g}, {k}, {t}" for g, k, t in terms]
    return ["*VISCOELASTIC, TIME=PRONY", *rows]


FEB = """<?xml version="1.0" encoding="ISO-8859-1"?>
<febio_spec version="4.0"><Module type="solid"/><Material>
<!-- typed in from a table -->
<material id="1" name="one" type="{}">{}</material></Material></febio_spec>"""

SIX = tuple(
    (g, 0.281 * 10.0**k)
    for g, k in zip(
        (0.1986, 0.1828, 0.1388, 0.2499, 0.1703, 0.0593),
        (-7, -5, -3, -1, 1, 3),
        strict=True,
    )
)
# Treloar 1944, doi:10.1039/TF9444000059: 8 % sulfur rubber, nominal stress in MPa.
TRELOAR = ((3.01, 0.85), (4.03, 1.21), (5.36, 1.94), (6.15, 2.67), (6.85, 3.75))

READ = (
    Published(
        "Ogden 1972, doi:10.1098/rspa.1972.0026: Treloar's rubber, three terms",
        "ogden.mac",
        """! unit system: N, mm, MPa
/PREP7
tb,hyper,2,,3,ogden
tbdata,,0.63,1.3,0.0012,5.0,
tbdata,,-0.01,-2.0
""",
        ogden((0.63, 1.3), (0.0012, 5), (-0.01, -2)),
        1.5 * (0.63 * 1.3 + 0.0012 * 5 + 0.01 * 2),
        unit="MPa",
        curve=TRELOAR,
    ),
    Published(
        "Arruda and Boyce 1993, doi:10.1016/0022-5096(93)90013-6: Treloar's rubber",
        "chain.INP",
        abaqus("** MPa", "*Hyperelastic,", "** of 1993", "Arruda-Boyce",
               "2.7D-1, 5.147815, 0.0, 23."),
        arruda_boyce(0.27, 5.147815**2),
        3 * 0.27 * (1 + 3 / (5 * 26.5) + 99 / (175 * 26.5**2)
                    + 513 / (875 * 26.5**3) + 42039 / (67375 * 26.5**4)),
        unit="MPa",
        curve=TRELOAR[:3],
    ),
    Published(
        "Marckmann and Verron 2006, doi:10.5254/1.3547969: Mooney for Treloar's rubber",
        "mooney.feb",
        FEB.format("Mooney-Rivlin", "<density>1</density><c1>0.162</c1>"
                   "<c2>5.90e-3</c2><k>1000</k>"
                   "<pressure_model>default</pressure_model>"),
        mooney(0.162, 5.90e-3),
        6 * (0.162 + 5.90e-3),
    ),
    Published(
        "Sorotoki (Caasenbrood), materials: Ecoflex 00-50, Yeoh in MPa",
        "silicone.inp",
        abaqus("*Density", "1.07e-9,", "*Hyperelastic, yeoh",
               "17e-3, -0.2e-3, 0.023e-3, 0., 0., 0.",
               "*Surface Interaction, name=skin", "1.,", "*Friction", "0.3,",
               "*Step, name=pull, nlgeom=YES", "*Static", "*End Step"),
        yeoh(17e-3, -0.2e-3, 0.023e-3),
        6 * 17e-3,
    ),
    Published(
        "TFEL/MFront gallery, Ogden: alpha 28.8, 0.4 MPa in the form of Abaqus, in Pa",
        "gel.inp",
        abaqus("** moduli in Pa", "*HYPERELASTIC, OGDEN, N=1, MODULI=LONG TERM",
               "4.e5, 28.8, 2.88e-8"),
        ogden((2 * 4e5 / 28.8, 28.8)),
        3 * 4e5,
        unit="Pa",
    ),
    Published(
        "guide, 8.4.1.2.2: Ogden of two terms that are a Mooney-Rivlin law",
        "two.mac",
        """TB,HYPER,1,,2,OGDEN   ! two terms
TBDATA,1,0.326996
TBDATA,2,2
TBDATA,3,-0.250152
TBDATA,4,-2
TBDATA,5,6.93063E-5
""",
        mooney(0.163498, 0.125076),
        6 * (0.163498 + 0.125076),
    ),
    Published(
        "guide, 8.4.1.2.3: neo-Hooke",
        "one.dat",
        "MYMU = 0.577148 ! psi\nTB,HYPER,1,1,2,NEO\nTBTEMP,20\n"
        "TBDATA,1,MYMU\nTBDATA,2,7.0e-5\n",
        mooney(0.577148 / 2),
        3 * 0.577148,
        unit="psi",
    ),
    Published(
        "guide, 8.4.1.2.9: compressible foam of two terms",
        "foam.mac",
        "TB,HYPER,1,,2,FOAM\nTBDATA,1,1.85,4.5,-9.20,-4.5,0.92\nTBDATA,,0.92\n",
        foam(0.92, (1.85, 4.5), (-9.20, -4.5)),
        (1.85 * 4.5 + 9.20 * 4.5) * (1 + 0.92 / 2.84),
        poisson=0.92 / 2.84,
    ),
    Published(
        "guide, 8.4.1.9: Mooney-Rivlin, bulk and shear relax alike",
        "visco.mac",
        "tb,hyper,1,,,moon\ntbdata,1,38.462E4,,1.2E-6\n"
        "tb,prony,1,,1,shear\ntbdata,1,0.5,2.0\ntb,prony,1,,1,bulk\ntbdata,,0.5,2.0\n",
        squeezable(38.462e4, 1.2e-6),
        6 * 38.462e4,
        ((0.5, 2.0),),
        poisson=(3 * 2 / 1.2e-6 - 4 * 38.462e4) / (6 * 2 / 1.2e-6 + 4 * 38.462e4),
    ),
    Published(
        "verification, material 3, incompressible",
        "three.inp",
        abaqus("*HYPERELASTIC, POLYNOMIAL, N=1, MODULI=INSTANTANEOUS", "1.5E6, 0.5E6",
               *prony((0.5, 0.0, 0.2), (0.49, 0.0, 0.5))),
        mooney(1.5e6, 0.5e6),
        6 * 2e6,
        ((0.5, 0.2), (0.49, 0.5)),
    ),
    Published(
        "verification, material 4: nearly incompressible, long-term moduli",
        "four.inp",
        abaqus("*HYPERELASTIC, N=1", "27.02, 1.42, 0.000001",
               *prony((0.25, 0.25, 5.0), (0.25, 0.25, 10.0))),
        mooney(2 * 27.02, 2 * 1.42),
        12 * (27.02 + 1.42),
        ((0.25, 5.0), (0.25, 10.0)),
    ),
    Published(
        "verification, material 6: six terms over ten decades, C01 below 0",
        "six.inp",
        abaqus("*HYPERELASTIC, MOONEY-RIVLIN, MODULI=INSTANTANEOUS",
               "550.53, -275.265, 7.E-7", *prony(*((g, 0.0, t) for g, t in SIX))),
        mooney(550.53, -275.265),
        6 * (550.53 - 275.265),
        SIX,
    ),
    Published(
        "verification, material 7: Ogden of two terms that are a Mooney-Rivlin law",
        "seven.inp",
        abaqus("*hyperelastic, ogden, n=2, moduli=instantaneous", "16., 2., 4., -2.",
               *prony((0.5, 0.0, 3.0))),
        mooney(8.0, 2.0),
        60.0,
        ((0.5, 3.0),),
    ),
    Published(
        "verification, material 8: Arruda-Boyce",
        "eight.inp",
        abaqus("*HYPERELASTIC, ARRUDA-BOYCE, MODULI = INSTANTANEOUS", "20., 7.",
               *prony((0.5, "", 3.0))),
        arruda_boyce(20.0, 49.0),
        3 * 20 * (1 + 3 / (5 * 49) + 99 / (175 * 49**2) + 513 / (875 * 49**3)
                  + 42039 / (67375 * 49**4)),
        ((0.5, 3.0),),
    ),
    Published(
        "febio, Arruda-Boyce",
        "chain.feb",
        FEB.format("Arruda-Boyce", "<mu>0.09</mu><N>26.5</N><k>100</k>"),
        arruda_boyce(0.09, 26.5),
        3 * 0.09 * (1 + 3 / (5 * 26.5) + 99 / (175 * 26.5**2)
                    + 513 / (875 * 26.5**3) + 42039 / (67375 * 26.5**4)),
    ),
    Published(
        "febio, Ogden",
        "ogden.feb",
        FEB.format("Ogden", "<m1>2.4</m1><c1>1</c1><k>100</k>"),
        ogden((1 / 2.4, 2.4)),
        1.5,
    ),
    Published(
        "GIBBON, demo of editing a .feb file: Ogden of one term beside a rigid body",
        "gibbon.feb",
        FEB.format("Ogden", "<c1>1.0000000e-03</c1><m1>1.2000000e+01</m1><k>1</k>"
                   '</material><material id="2" type="rigid body">'
                   "<density>1</density>"),
        ogden((1e-3 / 12, 12)),
        1.5e-3,
    ),
    Published(
        "Yao et al. 2012, doi:10.1115/1.4005693, table 2, sample 10: myocardium of the "
        "chick, Ogden and two terms, in Pa; a share of 0.02 lasts",
        "heart.inp",
        "** STRESS UNIT: Pa\n*MATERIAL, NAME=jelly\n*ELASTIC\n1., 0.3\n"
        + abaqus("*HYPERELASTIC, OGDEN, N=1, MODULI=INSTANTANEOUS", "6.62, 15.9, 0.",
                 *prony((0.49, "", 0.32), (0.49, "", 219))),
        ogden((2 * 6.62 / 15.9, 15.9)),
        3 * 6.62,
        ((0.49, 0.32), (0.49, 219.0)),
        unit="Pa",
    ),
)  # fmt: skip

REFUSED = (
    ("verification, material 1: the bulk alone relaxes", "one.inp",
     abaqus("*HYPERELASTIC, N=1, MODULI=INSTANTANEOUS", "8., 2., 0.1",
            *prony((0.0, 0.5, 3.0))), "Poisson ratio of 0.125"),
    ("verification, material 2: compressible, the shear alone relaxes", "two.inp",
     abaqus("*HYPERELASTIC, N=1, MODULI=INSTANTANEOUS", "8., 2., 0.1",
            *prony((0.5, 0.0, 3.0))), "Poisson ratio of 0.125"),
    ("verification, material 5: nearly incompressible when relaxed, not before",
     "five.inp",
     abaqus("*HYPERELASTIC, N=1", "8., 2., 0.001",
            *prony((0.5, 0.0, 1.0), (0.49, 0.0, 2.0))), "Poisson ratio of 0.125"),
    ("verification, material 9: Van der Waals", "nine.inp",
     abaqus("*HYPERELASTIC, VAN DER WAALS", "20., 10., 0.1, 0.02",
            *prony((0.5, 0.0, 3.0))), "not with VANDERWAALS"),
    ("Abaqus Benchmarks Guide, 3.1.4: Treloar's data for a fit", "fit.inp",
     abaqus("*HYPERELASTIC, N=2, TEST DATA INPUT", "*UNIAXIAL TEST DATA",
            "0.85E6, 2.01"), "not with TEST DATA INPUT"),
    ("Abaqus Example Problems Guide, 1.1.4: data of a foam for a fit", "punch.inp",
     abaqus("*HYPERFOAM, N=2, TEST DATA INPUT, POISSON=0.", "*UNIAXIAL TEST DATA",
            "-1000., -0.02"), "not with POISSON, TEST DATA INPUT"),
    ("guide, 8.4.1.2.1: Mooney-Rivlin of three constants", "three.mac",
     "TB,HYPER,1,,3,MOONEY\nTBDATA,1,0.163498,0.125076,0.014719,6.93063E-5\n",
     "MOONEY of 3 constants is not read"),
    ("Ansys Technology Showcase 15, 15.5.2, natural rubber: Mooney-Rivlin of five",
     "five.mac",
     "C10 = 1.787381e+00\nC01 = 5.722875e-02\nC20 =-5.876502e-02\nC11 = 2.684331e-02\n"
     "C02 =-5.112790e-03\nTB,HYPER,1,,5,MOONEY\nTBDATA,1,C10,C01,C20,C11,C02\n",
     "MOONEY of 5 constants is not read"),
    ("Ansys Technology Showcase, 50.3, hydrocephalus: a pore fluid", "brain.mac",
     "tb,hyper,1,,,NEO\ntbdata,1,3000,0.005\ntb,pm,1,,,perm\ntbdata,1,4.8e-8\n",
     "TB,PM changes the stress"),
    ("febio, uncoupled viscoelastic: the bulk modulus stands outside", "visco.feb",
     FEB.format("uncoupled viscoelastic", "<g1>0.95</g1><t1>0.01</t1><k>100</k>"
                '<elastic type="Mooney-Rivlin"><c1>1</c1><c2>0.0</c2></elastic>'),
     "Poisson ratio of 0.4808"),
    ("FEBio.jl, demo of a cube: neo-Hookean of FEBio, compressible", "cube.feb",
     FEB.format("neo-Hookean", "<E>1</E><v>0.4</v>"), "Poisson ratio of 0.4;"),
    ("interFEBio, examples: incomp neo-Hookean that is compressible", "biaxial.feb",
     FEB.format("incomp neo-Hookean", "<density>1</density><k>10</k><G>10</G>"),
     "Poisson ratio of 0.125"),
)  # fmt: skip


def given_by(tmp_path, name, text, **more):
    file = tmp_path / name
    file.write_text(text)
    return read_card(str(file), **more)


def held(given, stretch, time):
    """Stress of a strip held at a stretch, in the unit of the card."""
    chunk = Chunk(np.asarray(time, float), np.full(len(time), stretch - 1))
    return given.stored("MPa").stress(["a"], [chunk], [None])[0]


@pytest.mark.parametrize("one", READ, ids=lambda one: one.name)
def test_a_published_card_is_read_right(one, tmp_path):
    given = given_by(tmp_path, one.name, one.text)
    found = given.young * given.base().curve(STRETCH - 1)
    np.testing.assert_allclose(found, one.stress(STRETCH), rtol=1e-6)
    assert given.young == pytest.approx(one.young, rel=1e-9)
    assert given.poisson == pytest.approx(one.poisson, rel=1e-9)
    assert given.unit == one.unit
    assert given.shares == pytest.approx([g for g, _ in one.series])
    assert given.times_s == pytest.approx([t for _, t in one.series])
    for stretch, stress in one.curve:
        found = given.young * given.base().curve(np.array([stretch - 1.0]))
        assert found == pytest.approx(stress, rel=0.1)


@pytest.mark.parametrize("one", [x for x in READ if x.series], ids=lambda one: one.name)
def test_a_published_series_relaxes_as_its_sum(one, tmp_path):
    given = given_by(tmp_path, one.name, one.text)
    middle = one.series[-1][1]
    time = np.array([0.0, middle, 1e12])
    left = 1 - sum(g * -np.expm1(-time / t) for g, t in one.series)
    for stretch in (0.8, 1.5):
        expected = left * one.stress(np.array([stretch]))
        np.testing.assert_allclose(held(given, stretch, time), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("source", "name", "text", "said"), REFUSED, ids=[x[1] for x in REFUSED]
)
def test_a_published_card_that_is_not_known_is_refused(
    source, name, text, said, tmp_path
):
    with pytest.raises(InputError) as error:
        given_by(tmp_path, name, text)
    assert said in str(error.value), source
    assert "\n" not in str(error.value)


# -- kinds of decks --------------------------------------------------------------------

# Material 4 of the verification guide, as data that its own series gives.
TIMES = np.geomspace(0.5, 100, 16)
MODULUS = 1 - 0.25 * -np.expm1(-TIMES / 5) - 0.25 * -np.expm1(-TIMES / 10)
FOUR = ["*HYPERELASTIC, N=1, MODULI=INSTANTANEOUS", "27.02, 1.42, 0.000001",
        "*VISCOELASTIC, TIME=RELAXATION TEST DATA, NMAX=3"]  # fmt: skip


@pytest.mark.parametrize(
    ("keyword", "columns"),
    [
        ("*SHEAR TEST DATA", (MODULUS, TIMES)),
        ("*COMBINED TEST DATA", (MODULUS, MODULUS, TIMES)),
        ("*COMBINED TEST DATA", (MODULUS, np.ones(16), TIMES)),
        ("*SHEAR TEST DATA, SHRINF=0.5", (MODULUS[:9], TIMES[:9])),
    ],
)
def test_relaxation_data_of_a_published_series_give_its_curve(
    keyword, columns, tmp_path
):
    """Keywords Guide, *COMBINED TEST DATA: shear, bulk, time."""
    rows = [", ".join(f"{x:.7g}" for x in row) for row in zip(*columns, strict=True)]
    given = given_by(tmp_path, "a.inp", abaqus(*FOUR, keyword, *rows))
    found = held(given, 1.5, [0.0, *TIMES, 1e12])
    first = mooney(27.02, 1.42)(1.5)
    assert found[0] == pytest.approx(first)
    seen = len(columns[0])
    np.testing.assert_allclose(found[1 : seen + 1], first * MODULUS[:seen], rtol=0.02)
    if "SHRINF" in keyword:
        assert found[-1] == pytest.approx(first / 2, rel=1e-4)


def test_a_published_mullins_effect_softens_as_its_formula(tmp_path):
    """FElupe, OgdenRoxburgh: r=3, m=1, beta=0 with a neo-Hookean law of mu=1."""
    text = abaqus(
        "*HYPERELASTIC, NEO HOOKE", "0.5, 0.", "*MULLINS EFFECT", "3., 1., 0."
    )
    given = given_by(tmp_path, "a.inp", text)
    stretch = np.concatenate([np.linspace(1, 2.5, 3001), np.linspace(2.5, 1, 3001)[1:]])
    chunk = Chunk(np.arange(len(stretch), dtype=float), stretch - 1)
    (found,) = given.stored("MPa").stress(["a"], [chunk], [None])
    energy = 0.5 * (stretch**2 + 2 / stretch - 3)
    most = np.maximum.accumulate(energy)
    expected = (1 - erf(most - energy) / 3) * mooney(0.5)(stretch)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)


def test_a_mullins_effect_with_a_series_draws_a_note(tmp_path):
    """Abaqus Analysis Guide, Mullins effect: it is applied to the long-term modulus."""
    law = ["*HYPERELASTIC, NEO HOOKE", "0.5, 0.", "*MULLINS EFFECT", "3., 1., 0."]
    given = given_by(tmp_path, "a.inp", abaqus(*law, *prony((0.5, 0.0, 1.0))))
    assert "the lasting part alone" in given.notes[-1]


FOAM = ["*HYPERFOAM, N=1, MODULI=INSTANTANEOUS", "0.164, 8.88, 0.1"]


def test_a_foam_relaxes_as_a_whole(tmp_path):
    """Abaqus Analysis Guide, Time domain viscoelasticity: one series for both."""
    given = given_by(tmp_path, "a.inp", abaqus(*FOAM, *prony((0.4, 0.4, 2.0))))
    first = 2 * 0.164 / 8.88 * (0.6 ** (8.88 - 1) - 0.6 ** (-0.1 * 8.88 - 1))
    left = [1.0, 1 - 0.4 * -np.expm1(-1.0), 0.6]
    np.testing.assert_allclose(
        held(given, 0.6, [0.0, 2.0, 1e9]), first * np.array(left), rtol=1e-9
    )


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.inp", abaqus(*FOAM, *prony((0.4, 0.0, 2.0))), "relaxes as a whole"),
        ("a.mac", "TB,HYPER,1,,1,FOAM\nTBDATA,1,1.85,4.5,0.92\nTB,PRONY,1,,1,SHEAR\n"
         "TBDATA,1,0.4,2\n", "relaxes as a whole"),
        ("a.inp", abaqus("*HYPERFOAM, N=3", "1, 2, 1, 4, 1, 6, 0, 0", "0"), "N=3"),
        ("a.inp", abaqus("*HYPERELASTIC, NEO HOOKE", "0.5, -0.1"), "D or d is -0.1"),
        ("a.mac", "TB,HYPER,1,,,NEO\nTBDATA,1,0.5,-0.1\n", "D or d is -0.1"),
        ("a.inp", abaqus("*HYPERELASTIC, YEOH", "0.5, 0.1, 0.1, 1., 1., 0."),
         "more than one volume term"),
        ("a.inp", abaqus("*HYPERELASTIC, OGDEN", "0.5, 0., 0."), "exponent of its law"),
        ("a.feb", FEB.format("Ogden", "<c1>1</c1><k>100</k>"), "exponent of its law"),
        ("a.inp", abaqus("*HYPERELASTIC, OGDEN, N=3", "0.6, 1.3, 0.1, 5., 0.1, -2.",
                         "0.5, 1.3, 0.1, 5., 0.1, -2."), "has 8 numbers"),
        ("a.inp", abaqus(*FOUR, "*COMBINED TEST DATA", "0.9, 0.8, 1.", "0.8, 0.7, 2."),
         "bulk relaxation data"),
        ("a.inp", abaqus(*FOUR, "*COMBINED TEST DATA", "0.9, 1."), "3 numbers"),
        ("a.inp", abaqus(*FOUR, "*SHEAR TEST DATA, SHRINF=1.2", "0.9, 1."), "SHRINF"),
        ("a.inp", abaqus("*HYPERELASTIC, N=1", "8., 2., 0.001",
                         *prony((0.5, 1.0, 1.0))), "bulk add up to 1"),
        ("a.inp", abaqus("*HYPERELASTIC, OGDEN", "0.6, 1.3, 0.1, 5., 0.1, -2."),
         "is N right?"),
        ("a.mac", "TB,HYPER,1,,,OGDEN\nTBDATA,1,0.6,1.3,0.1,5,0,0\n",
         "is its NPTS right?"),
        ("a.mac", "TB,HYPER,1,,,NEO\nTBDATA,1,0.6\nTB,PRONY,1,,1,SHEAR\n"
         "TBDATA,1,0.2,1,0.2,10\n", "is its NPTS right?"),
        ("a.inp", abaqus(*FOAM, "*VISCOELASTIC, TIME=PRONY",
                         "0.2, 0.2, 1., 0.2, 0.2, 10."), "one term a line"),
        ("a.inp", abaqus(*FOAM, "*VISCOELASTIC, TIME=PRONY"), "one term a line"),
        ("a.inp", abaqus(*FOUR), "no *SHEAR TEST DATA"),
        ("a.inp", abaqus(*FOUR, *FOUR[:2]), "stands there twice"),
        ("a.feb", FEB.format("uncoupled viscoelastic", "<g1>0.5</g1><elastic "
                             'type="Ogden"><c1>1</c1><m1>2</m1><k>1000</k></elastic>'),
         "<t1> is missing"),
    ],
)  # fmt: skip
def test_what_would_change_the_stress_is_refused(name, text, said, tmp_path):
    with pytest.raises(InputError) as error:
        given_by(tmp_path, name, text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_unit_of_something_else_in_a_comment_draws_a_note(tmp_path):
    text = "** the rim is steel of 210 GPa\n" + READ[3].text
    given = given_by(tmp_path, "a.inp", text)
    strain = STRETCH - 1
    told = with_unit(given, strain, READ[3].stress(STRETCH))
    assert told.unit == "GPa"
    assert "--card-unit MPa" in told.notes[-1]
    meant = given_by(tmp_path, "a.inp", text, unit="MPa")
    assert with_unit(meant, strain, READ[3].stress(STRETCH)).notes == meant.notes


def test_a_compressible_law_of_another_volume_term_draws_a_note(tmp_path):
    text = abaqus("*HYPERELASTIC, ARRUDA-BOYCE", "20., 7., 0.02")
    given = given_by(tmp_path, "a.inp", text)
    assert given.poisson < 0.49
    assert "volume term" in given.notes[-1]
