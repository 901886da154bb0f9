"""Noise estimated from recordings against the noise that was drawn."""

import numpy as np
import pytest

from softnn.noise import estimate, quantum


def drawn(rng, n, sigma, phi):
    """AR(1) noise of variance sigma^2, started in its stationary state."""
    e = rng.standard_normal(n)
    x = np.empty(n)
    x[0] = e[0]
    for i in range(1, n):
        x[i] = phi * x[i - 1] + np.sqrt(1 - phi**2) * e[i]
    return sigma * x


def case(rng, sigma, phi, step=0.01, n=1500, share=0.0, recordings=4):
    times = [step * np.arange(n) for _ in range(recordings)]
    smooth = [np.sin(2 * np.pi * t / t[-1]) for t in times]
    noise = [
        drawn(rng, n, 1.0, phi) * np.sqrt(sigma**2 + (share * s) ** 2) for s in smooth
    ]
    return (
        [0.05 * s**3 + e for s, e in zip(smooth, noise, strict=True)],
        [s + e for s, e in zip(smooth, noise, strict=True)],
        times,
    )


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_level_and_colour_come_back(phi):
    found = estimate(*case(np.random.default_rng(1), 0.01, phi))
    for noise in found:
        assert noise.floor_MPa == pytest.approx(0.01, rel=0.15)
        assert noise.correlation == pytest.approx(phi, abs=0.08)
    if phi:
        seconds = -0.01 / np.log(phi)
        middle = np.median([n.correlation_s for n in found])
        assert middle == pytest.approx(seconds, rel=0.4)


def test_memory_that_is_long_beside_a_window_is_not_overstated():
    # A window of 48 samples is 1.9 s long, and less a cubic it says little of 1 s.
    time = 0.04 * np.arange(2500)
    levels, memories = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        noise = [drawn(rng, 2500, 0.01, np.exp(-0.04)) for _ in range(5)]
        (found, *_) = estimate(noise, noise, [time] * 5)
        levels.append(found.floor_MPa)
        memories.append(found.correlation_s)
    assert np.median(levels) == pytest.approx(0.01, rel=0.1)
    assert np.median(memories) == pytest.approx(1.0, rel=0.15)
    assert max(levels) < 0.0115
    assert max(memories) < 1.35


def test_recordings_of_different_clocks_share_a_correlation_time():
    rng = np.random.default_rng(2)
    slow = case(rng, 0.01, np.exp(-0.05 / 0.1), step=0.05)
    fast = case(rng, 0.01, np.exp(-0.01 / 0.1), step=0.01)
    found = estimate(*(a + b for a, b in zip(slow, fast, strict=True)))
    assert found[0].correlation_s == pytest.approx(0.1, rel=0.4)
    assert found[-1].correlation_s == pytest.approx(0.1, rel=0.4)
    assert found[0].correlation < found[-1].correlation


def test_level_that_grows_with_stress_is_recognised():
    found = estimate(*case(np.random.default_rng(3), 0.002, 0.0, share=0.02))
    assert found[0].share == pytest.approx(0.02, rel=0.25)
    assert found[0].sigma(np.array([1.0]))[0] == pytest.approx(0.0201, rel=0.2)


def test_quantised_channel_is_recognised():
    rng = np.random.default_rng(4)
    residual, stress, times = case(rng, 0.001, 0.0)
    step = 0.01
    rounded = [np.round(s / step) * step for s in stress]
    assert quantum(rounded[0]) == pytest.approx(step)
    assert quantum(stress[0]) == 0.0
    left = [r + q - s for r, q, s in zip(residual, rounded, stress, strict=True)]
    found = estimate(left, rounded, times)
    # Rounding to a step adds a uniform error, standard deviation step / sqrt(12).
    assert found[0].sigma(np.zeros(1))[0] == pytest.approx(step / np.sqrt(12), rel=0.2)


def test_missing_values_and_ten_samples_are_allowed():
    rng = np.random.default_rng(5)
    t = np.arange(10.0)
    x = 0.01 * rng.standard_normal(10)
    x[3] = np.nan
    (found,) = estimate([x], [x], [t])
    assert 0.001 < found.sigma(x)[0] < 0.1
