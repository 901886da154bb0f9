"""Effects of the measuring chain: what is written down is not what acted."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import bessel, lfilter, sosfilt, sosfilt_zi

from bench.concealed.planting import Context, Planted
from bench.concealed.programmes import STEP_S, Array, Imposed

VIBRATING = ("sine", "chirp", "two-tone")


def low_pass(signal: Array, time_s: float) -> Array:
    """One pole by the trapezoidal rule, starting settled on the first value."""
    a = STEP_S / (2 * time_s)
    b, p = a / (1 + a), (1 - a) / (1 + a)
    out, _ = lfilter([b, b], [1, -p], signal, zi=[(1 - b) * signal[0]])
    return out


def inertia(c: Context) -> Planted:
    """A mass whose force reaches 5-12 % of the peak stress in the sine."""
    form = c.pick("mass on a soft cell", "specimen's own mass")
    quickest = max(
        float(np.abs(acceleration(p.strain)[50:-50]).max())
        for p in c.programmes
        if p.family in VIBRATING
    )
    mass = c.peak * c.amount(0.05, 0.12) / quickest
    cell_s = c.rng.uniform(0.008, 0.014)

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        force = mass * acceleration(programme.strain)
        if form == "mass on a soft cell":
            return stress + low_pass(low_pass(force, cell_s), cell_s)
        # The part of the strip that moves grows thinner and longer as it stretches.
        return stress + force / (1 + programme.strain / 3)

    return Planted(
        "inertia",
        form,
        {"mass_MPa_s2": mass, "cell_s": cell_s},
        sensor=sensor,
    )


def acceleration(strain: Array) -> Array:
    """Second derivative of strain on the fine clock, 1/s2."""
    return np.gradient(np.gradient(strain, STEP_S), STEP_S)


def sensor_lag(c: Context) -> Planted:
    """The stress channel trails by 0.12-0.4 s in the mean."""
    form = c.pick("bessel", "running mean", "four poles")
    lag = c.amount(0.12, 0.4)

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        if form == "running mean":
            n = max(1, round(2 * lag / STEP_S))
            return uniform_filter1d(stress, n, mode="nearest", origin=(n - 1) // 2)
        if form == "bessel":  # an amplifier's, of third order
            corner_Hz = 1 / (2 * np.pi * lag)
            parts = bessel(3, corner_Hz, norm="delay", output="sos", fs=1 / STEP_S)
            settled = sosfilt_zi(parts) * stress[0]
            return np.asarray(sosfilt(parts, stress, zi=settled)[0])
        for _ in range(4):
            stress = low_pass(stress, lag / 4)
        return stress

    return Planted("sensor_lag", form, {"lag_s": lag}, sensor=sensor)


def load_cell_drift(c: Context) -> Planted:
    """0.6-1.5 peak stresses an hour, tared at the start of every recording."""
    form = c.pick("wandering", "slowing", "accelerating")
    rate = c.peak * c.amount(0.6, 1.5) / 3600 * float(c.rng.choice([-1, 1]))
    warm_s = c.rng.uniform(250, 800)
    seeds = c.rng.integers(0, 2**31, len(c.programmes))

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        t = programme.time_s
        if form == "slowing":
            return stress + rate * warm_s * np.log1p(t / warm_s)
        if form == "accelerating":
            return stress + rate * t * (0.7 + t / 700)
        walk = np.random.default_rng(seeds[i]).standard_normal(len(t)).cumsum()
        # After 300 s the walk has strayed by a tenth of the trend.
        walk *= 0.1 * abs(rate) * np.sqrt(300 * STEP_S)
        return stress + rate * t + walk - walk[0]

    return Planted(
        "load_cell_drift",
        form,
        {"rate_MPa_per_s": rate, "warm_s": warm_s},
        sensor=sensor,
    )


def zero_offset(c: Context) -> Planted:
    """3-8 % of the peak stress in a third of the recordings."""
    offsets = {
        i: c.peak * c.amount(0.03, 0.08) * float(c.rng.choice([-1, 1]))
        for i in c.some(1 / 3)
    }

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        return stress + offsets.get(i, 0.0)

    return Planted("zero_offset", "tare", {"offset_MPa": offsets}, sensor=sensor)


def gain_error(c: Context) -> Planted:
    """A scale error of 6-15 % in a third of the recordings."""
    gains = {
        i: 1 + c.amount(0.06, 0.15) * float(c.rng.choice([-1, 1]))
        for i in c.some(1 / 3)
    }

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        return stress * gains.get(i, 1.0)

    return Planted("gain_error", "cross-section", {"gain": gains}, sensor=sensor)


def load_cell_saturation(c: Context) -> Planted:
    """Clipped at 70-85 % of the peak, with a knee as an amplifier has it.

    At another strength the part cut off is scaled: half of it, half the cut.
    """
    form = c.pick("soft least", "settling")
    limit = c.peak * (1 - c.amount(0.15, 0.30))
    sharpness = c.rng.uniform(30, 80) / c.strength

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        x = np.abs(stress) / limit
        w = 1 / sharpness
        if form == "soft least":  # the lesser of signal and limit, rounded
            cut = np.logaddexp(0, (x - 1) / w) - np.logaddexp(0, -1 / w)
            kept = 1 - w * cut / (x + 1e-300)
        else:
            over = np.maximum(x - 1 + w, 0)
            kept = np.where(
                over > 0, (1 - w - w * np.expm1(-over / w)) / (x + 1e-300), 1
            )
        return stress * kept

    return Planted(
        "load_cell_saturation",
        form,
        {"limit_MPa": limit, "sharpness": sharpness},
        sensor=sensor,
    )
