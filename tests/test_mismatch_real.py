"""Diagnosis of real recordings, where they are at hand; slow.

The tests assert what the notes of the recordings say can be seen in them. What the
diagnosis does not reach yet belongs to issue 53, "real recordings: predict first".
"""

import os
from functools import cache

import numpy as np
import pytest

from bench.recordings.faults import FAULTS, faulty
from softnn.mismatch.case import Case
from softnn.mismatch.diagnosis import diagnose
from softnn.readers.tidy import read_set

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        "SOFTNN_DATA" not in os.environ, reason="SOFTNN_DATA: no real recordings"
    ),
]


def issue_53(said: str) -> pytest.MarkDecorator:
    """Expected to fail, strictly: a test that begins to pass says so."""
    return pytest.mark.xfail(strict=True, reason=f"issue 53: {said}")


def said(told: dict) -> set[str]:
    """Names, and laws of which one is surely there."""
    members = (c["members"] for c in told["classes"])
    return set(told["selected"]).union(*members)


@cache
def result(name, part, own_specimens=False):
    recordings = tuple(r for r in read_set(name) if part in r.name)
    specimen = {r.name: r.specimen for r in recordings} if own_specimens else {}
    return diagnose(Case(name, recordings, specimen=specimen)).result


def test_acrylic_tape_is_viscous_at_finite_strain_but_does_not_soften():
    found = result("vhb4910-zhao", "lu_")
    assert "mullins_softening" not in found["selected"]
    assert said(found) & {"finite_strain", "nonlinear_viscosity"}
    assert found["fit"]["after"]["heldout_nrmse"] < 0.035


def test_acrylic_tape_buckles():
    found = result("vhb4910-zhao", "lu_")
    assert "tension_only" in found["selected"] or "slack" in found["selected"]


@pytest.mark.parametrize("group", ["leap_t", "new_heel"])
def test_foam_softens_on_reloading_and_keeps_a_set(group):
    found = result("foam-tpe-tension-cyclic", group, own_specimens=True)
    assert "mullins_softening" in found["selected"]
    assert "permanent_set" in said(found)
    assert found["fit"]["heldout_ratio"] < 0.25
    assert found["fit"]["after"]["heldout_nrmse"] < 0.04


@pytest.mark.parametrize(
    "fault",
    [
        "",
        "slack",
        "offset",
    ],
)
def test_what_sets_some_specimens_apart_is_named_on_top(fault):
    recordings = [r for r in read_set("foam-tpe-tension-cyclic") if "turbo" in r.name]
    case = Case(
        "foam", tuple(recordings), specimen={r.name: r.name for r in recordings}
    )
    if fault:
        case = faulty(case, FAULTS[fault], 1.0, np.random.default_rng(0)).case
    expected = {FAULTS[fault].effect} if fault else set()
    told = diagnose(case).result
    assert set(told["selected"]) - {"permanent_set"} == {"mullins_softening"} | expected
    assert "permanent_set" in said(told)


@pytest.mark.exhaustive  # two minutes: a tape that a test above diagnoses, three times
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(
            "slack", marks=issue_53("beside slack another viscous law is named")
        ),
        "offset",
        "clip",
    ],
)
def test_what_recordings_show_by_themselves_is_named_beside_the_material(fault):
    recordings = [r for r in read_set("vhb4910-zhao") if "lu_" in r.name]
    rng = np.random.default_rng(1)
    case = faulty(Case("tape", tuple(recordings)), FAULTS[fault], 1.0, rng).case
    found = set(diagnose(case).result["selected"])
    assert found == {"finite_strain", "tension_only", FAULTS[fault].effect}


@pytest.mark.parametrize("machine", ["bluehill", "wavematrix"])
def test_silicone_shows_the_inertia_of_the_grips_and_no_strong_softening(machine):
    # SOURCE.md: force spikes at every reversal; softening of two per cent at most.
    found = result("silicone30a-instron", machine)
    assert "inertia" in found["selected"]
    for told in found["explanations"]:
        assert told["effect"] != "mullins_softening"
