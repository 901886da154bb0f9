"""A case drawn: material, machine, noise, what is concealed, and how strongly.

Conditions are put on two things only: the base named must be able to represent the
material when nothing is concealed (`ADEQUATE`), and what is concealed must be able to
reach the energy drawn for it. No diagnosis is asked.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bench.hands.bases import Base
from bench.hands.bending import Bends, simulate_bent
from bench.hands.families import SIDES, Array, Rng, loguniform
from bench.hands.materials import SKELETONS, draw_material
from bench.hands.noises import KINDS, Noise, draw_noise
from bench.hands.orders import CLASSES, MODELS, USUAL, ordered
from bench.hands.programmes import PROGRAMMES, Course, Habits, Programme, draw_course
from bench.hands.testing import Act, Law, Planted, Setup, simulate

ADEQUATE = 3.0
ENERGIES = (20.0, 30000.0)
BENT = (1000.0, 1e6)  # energies of what is bent
QUIET = (0.1, 0.5)  # of the usual noise, over which it is seen
BARE = 0.1  # of what any law would leave, that the bare response bent may leave
AGAIN = 100  # tries, after which another base and another material are drawn
BACK_AND_FORTH = {
    "mullins_softening",
    "permanent_set",
    "friction_hysteresis",
    "cyclic_softening",
    "tension_only",
    "inertia",
}


@dataclass(frozen=True)
class Case:
    """All of a case, before it is written."""

    cls: str
    side: str
    setup: Setup
    habits: Habits
    noise: Noise
    laws: tuple[Law, ...]
    planted: list[tuple[Act, float]]
    specimens: str  # none, said or unsaid
    temperature: bool
    missing: float
    energies: dict[str, Any]
    tries: int
    rng: Rng = field(repr=False)
    bends: Bends | None = None

    def stress(self, held: bool = False) -> list[Array]:
        """Noise-free, at the samples of the recordings, or of those held."""
        if self.bends is None:
            return simulate(self.setup, self.planted, held)
        return simulate_bent(self.setup, self.planted, self.bends, held)


def _habits(rng: Rng, effects: set[str], model: str, home: bool, warm: bool) -> Habits:
    mode = str(rng.choice(["tension", "compression", "mixed"], p=[0.55, 0.25, 0.2]))
    if "tension_only" in effects:  # in tension: only what has relaxed is compressed
        mode = str(rng.choice(["mixed", "tension"]))
    if "finite_strain" in effects and mode == "mixed":
        mode = "tension"
    most = {"tension": 1.0, "compression": 0.4, "mixed": 0.3}[mode]
    least = 0.04
    if "finite_strain" in effects:
        least, most = (0.5, 2.0) if mode == "tension" else (0.3, 0.6)
    pace = loguniform(rng, 2.0, 25.0)
    if effects & {"sensor_lag", "inertia"} or rng.random() < 0.25:
        pace = loguniform(rng, 0.8, 4.0)
    return Habits(
        loguniform(rng, least, most),
        mode,
        pace,
        home,
        bool(rng.random() < 0.15),
        0.0 if rng.random() < 0.5 else loguniform(rng, 0.03, 0.4),
        float(rng.uniform(2, 15)) if warm else 0.0,
        float(rng.uniform(18, 27)),
    )


def _programmes(rng: Rng, side: str, effects: set[str], monotone: bool, n: int):
    kinds = [p for p in PROGRAMMES if p.side == side and (p.monotone or not monotone)]
    chosen: list[Programme] = []
    while len(chosen) < n:
        chosen += [kinds[k] for k in rng.permutation(len(kinds))]
    chosen = chosen[:n]
    if "cyclic_softening" in effects:
        chosen[:2] = [k for k in kinds if k.cyclic][:2]
    if "inertia" in effects:
        chosen[:2] = [k for k in kinds if k.smooth][:1] * 2
    return [chosen[k] for k in rng.permutation(n)]


def draw_setup(
    rng: Rng, side: str, laws: tuple[Law, ...], model: str, skeleton: int
) -> tuple[Setup, Habits, str, bool]:
    """Material and machine; how specimens are told; whether warmth is recorded."""
    effects = {law.effect for law in laws}
    names = {law.name for law in laws}
    monotone = not effects & BACK_AND_FORTH and rng.random() < 0.12
    fresh = monotone or any(law.stage == "rig" for law in laws) or rng.random() < 0.85
    heat = "thermal_softening" in effects or "thermal_expansion" in names
    warm = heat or rng.random() < 0.25
    habits = _habits(rng, effects, model, not fresh, warm)
    n = int(rng.integers(4, 10))
    recorded = _programmes(rng, side, effects, monotone, n)
    top = int(rng.integers(n))
    courses: list[Course] = [
        draw_course(rng, p, habits, i == top) for i, p in enumerate(recorded)
    ]
    for p in _programmes(rng, side, set(), False, 2):
        courses.append(draw_course(rng, p, habits, False))
    kinds = [s for s in SKELETONS if s.side == side]
    mid = habits.pace_s * loguniform(rng, 0.3, 3)
    material = draw_material(
        rng, side, model, habits.em, mid, kinds[skeleton % len(kinds)]
    )
    specimens, factors = "none", np.ones(n)
    if fresh and "gain_error" not in effects and rng.random() < 1 / 3 / 0.85:
        specimens = str(rng.choice(["said", "unsaid"]))
        factors = 1 + loguniform(rng, 0.01, 0.04) * rng.standard_normal(n)
    setup = Setup(
        model,
        habits.mode,
        material,
        courses,
        n,
        not fresh,
        factors,
        habits.em,
        habits.pace_s,
        habits.rest_C,
        habits.swing_C,
    )
    setup.settle()
    return setup, habits, specimens, warm


def strength_for(base: Base, act: Act, goal: float) -> tuple[float, float]:
    """The strength at which the base is left with `goal`, and what it is left with."""

    def left_at(a: float) -> float:
        return base.energy(simulate(base.setup, [(act, a)]))

    a, left = act.limit, left_at(act.limit)
    if not np.isfinite(left) or left <= goal:
        return a, left
    low, high = 1e-6 * act.limit, a
    if act.least:
        low, weakest = act.least, left_at(act.least)
        if weakest >= goal:
            return low, weakest
    for _ in range(8):
        guess = a * np.sqrt(goal / max(left, 1e-9))
        a = float(guess if low < guess < high else np.sqrt(low * high))
        left = left_at(a)
        if abs(np.log(left / goal)) < 0.15:
            break
        low, high = (a, high) if left < goal else (low, a)
    return a, left


def measured(
    base: Base, laws: tuple[Law, ...], planted: Planted, alone: list[float]
) -> dict[str, Any]:
    """Energies for the truth file."""
    clean = simulate(base.setup, planted)
    out: dict[str, Any] = {}
    keys = [
        "alien:" + law.name if law.effect == "alien" else law.effect for law in laws
    ]
    if laws:
        out["energy_alone"] = dict(zip(keys, alone, strict=True))
    if len(laws) == 2:
        beyond = {}
        for k, key in enumerate(keys):
            other = simulate(base.setup, [planted[1 - k]])
            step = [o - b for o, b in zip(other, base.clean, strict=True)]
            beyond[key] = base.energy(clean, step)
        out["energy_beyond_the_other"] = beyond
    out["energy_after_refit"] = base.energy(clean)
    return out


def _bends(
    rng: Rng, laws: tuple[Law, ...], base: Base, most: float
) -> tuple[Bends, float]:
    """Bends; that of the bare response leaves less than `most`, and how much."""
    bends = Bends.draw(rng, laws, base.setup)
    while True:
        alone = replace(bends, laws=())
        left = base.energy(simulate_bent(base.setup, (), alone))
        if left < most:
            return bends, left
        bends = bends.milder()


def draw(seed: int, index: int, cls: str, side: str) -> Case:
    """The case of this number, from families of this side only."""
    laws = ordered(seed, index, cls, side)
    start = np.random.default_rng([seed, SIDES.index(side), CLASSES.index(cls), index])
    skeleton = int(start.integers(1000))
    kinds = [k for k, s in KINDS.items() if s == side]
    kind = kinds[start.integers(len(kinds))]
    low, high = BENT if cls == "bent" else ENERGIES
    goals = [loguniform(start, low, high) for _ in laws]
    models: tuple[str, ...] = USUAL
    for law in laws:
        models = tuple(m for m in models if m in MODELS.get(law.effect, USUAL))
        models = models or MODELS[law.effect]
    first = int(start.integers(len(models)))
    for tries in range(1, 400):
        # Of some materials at large strain one base or other is never adequate.
        turn = tries // AGAIN
        model = models[(first + turn) % len(models)]
        rng = np.random.default_rng(
            [seed, SIDES.index(side), CLASSES.index(cls), index, tries]
        )
        setup, habits, specimens, warm = draw_setup(
            rng, side, laws, model, skeleton + turn
        )
        bare = simulate(setup, ())
        quiet = loguniform(rng, *QUIET) if cls == "bent" else 1.0
        noise = draw_noise(rng, kind, bare, habits.pace_s, quiet)
        base = Base(setup, noise, specimens != "none")
        basic = base.energy(bare)
        if basic > ADEQUATE:
            continue
        planted, alone = [], []
        for law, goal in zip(laws, goals, strict=True):
            act = law.make(rng, setup)
            a, left = strength_for(base, act, goal)
            planted.append((act, a))
            alone.append(left)
        if not all(0.8 * ENERGIES[0] < e < 1.5 * high for e in alone):
            continue
        energies = {"energy_of_base_alone": basic}
        bends = None
        if cls == "bent":
            bends, bare_left = _bends(rng, laws, base, BARE * min(alone))
            energies["energy_of_bare_bent"] = bare_left
        energies |= measured(base, laws, planted, alone)
        missing = float(rng.uniform(0.002, 0.02)) if rng.random() < 0.2 else 0.0
        case = Case(
            cls,
            side,
            setup,
            habits,
            noise,
            laws,
            planted,
            specimens,
            warm,
            missing,
            energies,
            tries,
            rng,
            bends,
        )
        if bends:
            energies["energy_after_refit"] = base.energy(case.stress())
        return case
    raise RuntimeError(f"{side} {cls} {index} of seed {seed}: no case in 400 tries")
