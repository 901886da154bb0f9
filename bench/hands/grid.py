"""One effect at a chosen strength, in noise of a chosen level and memory.

A case keeps its material, programmes and draws over all strengths: the same specimens
with more of the effect. Strength 1 is clear: in white noise of `USUAL` the base is left
with an energy of `CLEAR`, whatever the effect, or the law is at its limit.
"""

from __future__ import annotations

import numpy as np

from bench.hands.bases import Base
from bench.hands.drawing import (
    ADEQUATE,
    AGAIN,
    Case,
    draw_setup,
    measured,
    strength_for,
)
from bench.hands.families import EFFECTS, SIDES
from bench.hands.noises import given
from bench.hands.orders import MODELS, USUAL, laws_of
from bench.hands.power import degrees, power
from bench.hands.testing import Planted, simulate

LEVEL, CLEAR = 0.005, 10_000.0
NOTHING = ""


def at(
    seed: int,
    index: int,
    effect: str,
    strength: float,
    level: float,
    memory_s: float,
    side: str,
) -> Case:
    """The case of this number; `effect` may be `NOTHING`.

    `level` is a share of the range of the stress without the effect, `memory_s` the
    correlation time of the noise in s (0: white).
    """
    laws = laws_of(effect, side) if effect else []
    laws = [laws[index % len(laws)]] if laws else []
    key = [seed, SIDES.index(side), (*EFFECTS, NOTHING).index(effect), index]
    start = np.random.default_rng(key)
    models = MODELS.get(effect, USUAL)
    first, skeleton = int(start.integers(len(models))), int(start.integers(1000))
    for tries in range(1, 400):
        turn, rng = tries // AGAIN, np.random.default_rng([*key, tries])
        model = models[(first + turn) % len(models)]
        setup, habits, specimens, warm = draw_setup(
            rng, side, tuple(laws), model, skeleton + turn
        )
        bare = simulate(setup, ())
        noise = given(level, memory_s, bare)
        base = Base(setup, noise, specimens != "none")
        basic = base.energy(bare)
        if basic > ADEQUATE:
            continue
        planted: Planted = []
        alone: list[float] = []
        if laws:
            act = laws[0].make(rng, setup)
            usual = Base(setup, given(LEVEL, 0.0, bare), specimens != "none")
            clear, _ = strength_for(usual, act, CLEAR)
            planted = [(act, max(strength * clear, act.least))]
            alone = [base.energy(simulate(setup, planted))]
        if not np.isfinite(alone).all():
            continue
        seen = [
            power(energy, degrees(one))
            for energy, (one, _) in zip(alone, planted, strict=True)
        ]
        told = measured(base, tuple(laws), planted, alone)
        return Case(
            "single" if laws else "null",
            side,
            setup,
            habits,
            noise,
            tuple(laws),
            list(planted),
            specimens,
            warm,
            0.0,
            {"energy_of_base_alone": basic, **told, "oracle_power": seen},
            tries,
            rng,
        )
    raise RuntimeError(f"{effect or 'null'} {index} of seed {seed}: no case")
