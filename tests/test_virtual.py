"""The generator against closed forms, a second route and the published tables."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import studies
from bench import calibration
from softnn import prepare, virtual
from softnn.contracts import InputError
from softnn.materials import MATERIALS, material, table
from softnn.recording import data_hash
from studies import virtual_specimens

LINEAR = virtual.Calibration(
    knee_stress=0.0,
    knee_strain=1.0,
    knee_sharpness=1.0,
    modulus=2.0,
    upturn=0.0,
    upturn_strain=1.0,
    branch_moduli=(3.0, 0.5),
    branch_times=(0.7, 20.0),
    branch_share=1.0,
    branch_strain=1.0,
    scatter=0.0,
    relaxation_slack_mm=0.0,
    stiffness={},
    extensibility={},
)
MEAN = virtual.Specimen()


def test_linear_material_at_constant_rate_follows_the_closed_form():
    rate, time = 0.25, np.linspace(0, 8, 401)
    maxwell = sum(
        k * rate * tau * (1 - np.exp(-time / tau))
        for k, tau in zip(LINEAR.branch_moduli, LINEAR.branch_times, strict=True)
    )
    found = virtual.stress(LINEAR, rate * time, time[1], MEAN)
    np.testing.assert_allclose(found, 2.0 * rate * time + maxwell, rtol=1e-12)


def test_saturating_branches_follow_their_differential_equation():
    c = virtual.calibration("FR")
    rate, end = 0.25, 12.0
    tau = np.array(c.branch_times)

    def slope(t, q):
        soft = np.exp(-rate * t / c.branch_strain)
        return rate * (c.branch_share + (1 - c.branch_share) * soft) - q / tau

    q = solve_ivp(slope, (0, end), 0 * tau, "BDF", rtol=1e-10, atol=1e-13).y[:, -1]
    strain = rate * np.linspace(0, end, 20_001)
    with_branches = virtual.stress(c, strain, end / 20_000, MEAN)
    without = replace(c, branch_moduli=(0.0,) * len(tau))
    equilibrium = virtual.stress(without, strain, end / 20_000, MEAN)
    found = with_branches[-1] - equilibrium[-1]
    assert found == pytest.approx(q @ c.branch_moduli, rel=1e-6)


def test_a_hold_is_the_ramp_carried_on_at_constant_strain():
    m, c = material("NR"), virtual.calibration("NR")
    test = {"elongation": 6.0, "duration": 1.0}
    time, elongation, stress = virtual.hold(m, c, test, MEAN)
    ramp = 6.0 / (500 / 60)
    fine = np.arange(0, ramp + 60, ramp / 1000)
    strain = np.minimum(fine / ramp, 1) * 6.0 / 33
    longhand = np.interp(time, fine, virtual.stress(c, strain, fine[1], MEAN))
    held = time > ramp
    np.testing.assert_allclose(stress[held], longhand[held], rtol=1e-4)
    assert elongation[-1] == 6.0
    assert time[-1] == pytest.approx(ramp + 60)


@pytest.mark.parametrize("name", MATERIALS)
def test_specimens_and_samples_are_those_of_tables_4_1_4_3_and_6_2(name):
    m = material(name)
    pulled = virtual.tensile(name)
    for speed in m.speeds:
        group = [r for r in pulled if r.rate_per_s == m.rate_per_s(speed)]
        assert len(group) == m.specimens[speed]
        assert sum(map(len, group)) == m.samples[speed]
    held = virtual.relaxation(name)
    assert len(held) == sum(t["recordings"] for t in m.relaxation.values())
    for r in pulled + held:
        assert r.source.startswith("virtual specimen")
        np.testing.assert_allclose(r.stress_MPa, r.force_N / r.geometry.area)
        np.testing.assert_allclose(r.strain, r.elongation_mm / 33)
        low, high = m.thickness_mm
        assert low <= r.geometry.thickness_mm <= high


@pytest.mark.parametrize("name", MATERIALS)
def test_ultimate_strains_have_the_published_median_and_mean(name):
    m = material(name)
    for speed in m.speeds:
        row = m.elastic[speed]
        median, mean = row["ultimate_strain_median"], row["ultimate_strain_mean"]
        scores = np.random.default_rng(1).normal(size=m.specimens[speed])
        found = virtual._ultimate_strains(median, mean, virtual._ranks(scores))
        assert np.median(found) == pytest.approx(median, rel=1e-12)
        assert found.min() > 0
        if len(found) > 1:
            assert found.mean() == pytest.approx(mean, rel=1e-12)
            assert (np.diff(found[scores.argsort()]) >= 0).all()


def test_every_specimen_slacks_holds_and_breaks():
    for r in virtual.tensile("SR"):
        peak = r.force_N.max()
        slack = r.elongation_mm < 0.2
        assert np.abs(r.force_N[slack]).max() < 0.05 * peak
        assert r.force_N[-5:].max() < 0.05 * peak
        np.testing.assert_allclose(np.diff(r.time_s), r.time_s[1])
        cut = prepare.cut_failure(r)
        assert 0 < len(r) - len(cut) < 40


def test_the_load_cell_has_the_noise_and_resolution_it_declares():
    r = virtual.relaxation("NR")[0]
    level = prepare.white_noise(r.force_N[r.time_s > 200])
    assert level == pytest.approx(virtual.NOISE_N, rel=0.1)
    counts = r.force_N / virtual.RESOLUTION_N
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)


def test_a_seed_gives_one_set_of_specimens():
    m, c = material("NatPolR"), virtual.calibration("NatPolR")
    once, again, other = (virtual.build(m, c, "tensile", s) for s in (3, 3, 4))
    assert data_hash(once) == data_hash(again) != data_hash(other)
    assert data_hash(once) == data_hash(virtual.tensile("NatPolR", seed=3))
    with pytest.raises(InputError, match="seed is -1"):
        virtual.tensile("NatPolR", seed=-1)


DIGESTS = """
import json
from softnn import prepare, virtual
from softnn.materials import MATERIALS
from softnn.recording import data_hash
found = {}
for name in MATERIALS:
    pulled = [prepare.specimen(r, samples=100) for r in virtual.tensile(name)]
    found[name] = data_hash([*pulled, *virtual.relaxation(name)])
print(json.dumps(found))
"""
VECTORS = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
PLAIN = {  # Prescott (SSE3) is the oldest x86 kernel; other machines ignore it
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": " ".join(VECTORS),
}


@pytest.mark.parametrize("changed", [{}, PLAIN], ids=["this processor", "plain"])
def test_prepared_specimens_are_the_same_to_the_last_bit_on_any_processor(changed):
    """The kept digests: by the kernels of this processor, and by the plainest ones."""
    kept = {}
    for path in (Path(studies.__path__[0]) / "best").glob("architectures-*.json"):
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["settings"]["data"] == "virtual":
            assert content["settings"]["samples"] == 100
            kept[content["settings"]["material"]] = content["data_sha256"]
    run = subprocess.run(
        [sys.executable, "-c", DIGESTS],
        env=os.environ | changed,
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(run.stdout) == kept


@pytest.mark.parametrize("name", MATERIALS)
def test_scatter_is_what_the_published_networks_could_not_learn(name):
    published = table("6.6").row(material=name, model="ANN")
    recordings = virtual.tensile(name)
    found = 100 * calibration.unexplained(recordings)
    assert found == pytest.approx(published["generalisation_error"], rel=0.05)
    # R2 was not fitted: that it comes out is what supports the inference. NatR has
    # more of its stress in the upturn than the thesis's specimens had.
    ready = [prepare.specimen(r, samples=len(r)) for r in recordings]
    stress = np.concatenate([r.stress_MPa for r in ready])
    r2 = 100 - found**2 * np.mean(stress**2) / np.var(stress) / 100
    assert r2 == pytest.approx(published["r2"], abs=4 if name == "NatR" else 1)


def test_unexplained_scatter_of_two_known_curves():
    # Curves f x and (2 - f) x leave (f - 1) x about their mean x.
    strain = np.linspace(0, 1, 500)
    pair = [
        replace(
            virtual.tensile("NR")[0],
            time_s=strain,
            strain=strain,
            stress_MPa=f * strain,
            force_N=None,
            elongation_mm=None,
        )
        for f in (0.9, 1.1)
    ]
    expected = 0.1 / np.sqrt(1 + 0.1**2)
    assert calibration.unexplained(pair) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", MATERIALS)
def test_published_properties_are_recovered_or_the_reason_is_given(name):
    rows = list(virtual_specimens.compare(name))
    assert len(rows) == 8 * len(material(name).speeds) + 3 * len(
        material(name).relaxation
    )
    missed = [abs(r["deviation"]) for r in rows]
    assert np.median(missed) < 0.06
    for row, miss in zip(rows, missed, strict=True):
        assert (miss > virtual_specimens.LISTED) == (row["reason"] is not None), row


def test_other_seeds_recover_the_properties_too():
    for seed in (1, 2):
        rows = virtual_specimens.compare("FR", seed)
        assert np.median([abs(r["deviation"]) for r in rows]) < 0.06


def test_study_writes_and_prints_its_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert virtual_specimens.main(["--smoke"]) == 0
    assert "median_deviation" in capsys.readouterr().out
    folder = tmp_path / "mlruns" / "smoke" / "results"
    result = json.loads((folder / "virtual_specimens.json").read_text())
    assert result["headline"]["properties"] == 30
    assert (folder / "virtual_specimens.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_calibration_can_be_repeated():
    m = material("SR")
    fitted = calibration.calibrate("SR")
    pulled, held = (virtual.build(m, fitted, test, 0) for test in virtual.TESTS)
    again = calibration.measured(m, pulled, held)
    for row in virtual_specimens.compare("SR"):
        found = again[row["where"], row["property"]]
        assert found == pytest.approx(row["found"], rel=0.03)


def test_calibrations_are_stored_as_they_are_written(tmp_path):
    for name in MATERIALS:
        path = calibration.write(name, virtual.calibration(name), tmp_path)
        kept = calibration.data_path() / "virtual" / f"{name}.toml"
        assert path.read_text() == kept.read_text()
