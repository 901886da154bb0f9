"""A concealed case: drawn from a seed, run on the fine clock, written, its key sealed.

What a diagnosis may see goes to `cases/`; what was planted goes to the key. Names of
cases and recordings say nothing, and their order is shuffled.
"""

from __future__ import annotations

import gzip
import hashlib
import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from studies.concealed import material, oracle, rig, sensor
from studies.concealed.bases import Base, draw_base
from studies.concealed.noises import LEVELS, draw_noise
from studies.concealed.planting import (
    Context,
    Planted,
    run_material,
    run_sensor,
    specimen_strains,
)
from studies.concealed.programmes import (
    FAMILIES,
    HELD_OUT,
    STEP_S,
    Array,
    Imposed,
    Pace,
    sample,
    zigzag,
)
from studies.concealed.unlisted import UNLISTED

# In the order of a measurement; within the material, what changes the spring first.
EFFECTS: tuple[Callable[[Context], Planted], ...] = (
    rig.slack,
    rig.grip_slip,
    material.nonlinear_elasticity,
    material.mullins_softening,
    material.permanent_set,
    material.friction_hysteresis,
    material.relaxation_branch,
    material.nonlinear_viscosity,
    material.strain_dependent_relaxation,
    material.finite_strain,
    material.thermal_softening,
    material.cyclic_softening,
    material.tension_only,
    sensor.inertia,
    sensor.sensor_lag,
    sensor.load_cell_drift,
    sensor.zero_offset,
    sensor.gain_error,
    sensor.load_cell_saturation,
)
NAMES = tuple(plant.__name__ for plant in EFFECTS)
SENSORS = NAMES[NAMES.index("inertia") :]
# Sizes that a recording has for itself alone say nothing about the next one.
OWN_SIZE = {"slack", "grip_slip", "zero_offset", "gain_error"}
# Two of these are two forms of one thing, or ask for programmes that exclude each
# other (compression shows tension-only; a slack strip cannot be compressed).
NOT_TOGETHER = (
    {"tension_only", "slack"},
    {"tension_only", "grip_slip"},
    {"finite_strain", "strain_dependent_relaxation"},
    {"finite_strain", "nonlinear_elasticity"},
    {"finite_strain", "relaxation_branch"},
    {"nonlinear_viscosity", "relaxation_branch"},
)
NEEDS_SINE = ("cyclic_softening", "inertia", "sensor_lag")
FIRST_TRIAL_SEED = 10_000  # below: development; from here on also held-out programmes


@dataclass(frozen=True)
class Order:
    """What is to be forged: one case."""

    name: str
    group: str  # "single", "pair", "null" or "unlisted"
    effects: tuple[str, ...]
    strength: float
    seed: int
    number: int
    dirty: bool = False
    simulated: bool = False


def order_of(answer: Mapping[str, Any]) -> Order:
    """The order that an answer of the key belongs to: it can be forged again."""
    return Order(
        answer["case"],
        answer["group"],
        tuple(answer["effects"]),
        *(answer[k] for k in ("strength", "seed", "number", "dirty", "simulated")),
    )


@dataclass(frozen=True)
class Forged:
    """One case: tables to be written, the public toml, and the answer."""

    tables: dict[str, pd.DataFrame]
    toml: str
    answer: dict[str, Any]


@dataclass(frozen=True)
class Setting:
    """The case before anything is planted in it."""

    model: str
    base: Base
    pace: Pace
    programmes: tuple[Imposed, ...]
    temperatures: tuple[Array, ...]
    continued: bool
    gains: tuple[float, ...]  # of the specimens; ones without a specimen table
    specimens: tuple[str, ...]
    warm: bool  # whether a temperature channel is written
    level: float  # of noise

    def bare(self) -> list[Array]:
        return run_material(
            self.base, (), self.programmes, self.temperatures, self.continued
        )

    def run(self, planted: Sequence[Planted]) -> list[Array]:
        stress = run_material(
            self.base, planted, self.programmes, self.temperatures, self.continued
        )
        stress = [g * s for g, s in zip(self.gains, stress, strict=True)]
        return run_sensor(planted, self.programmes, stress)

    def sampled(self, signals: Sequence[Array]) -> Array:
        return np.concatenate(
            [s[p.index] for s, p in zip(signals, self.programmes, strict=True)]
        )


def draw_model(rng: np.random.Generator, effects: Sequence[str]) -> str:
    """A model that leaves the effects out, and nothing else."""
    if "nonlinear_elasticity" in effects:
        if "relaxation_branch" in effects:
            return "sls"
        return str(rng.choice(["wiechert", "sls"], p=[0.6, 0.4]))
    if "relaxation_branch" in effects:
        return str(rng.choice(["sls", "pl-sls"]))
    if "finite_strain" in effects:
        return "pl-wiechert"
    if "strain_dependent_relaxation" in effects:
        return str(rng.choice(["pl-wiechert", "wiechert"], p=[0.75, 0.25]))
    models = ["pl-wiechert", "wiechert", "pl-sls", "sls", "hooke"]
    return str(rng.choice(models, p=[0.65, 0.12, 0.10, 0.08, 0.05]))


def draw_setting(rng: np.random.Generator, order: Order) -> Setting:
    """Model, material, machine and habits of one case."""
    effects = order.effects
    model = draw_model(rng, effects)
    wide = "finite_strain" in effects
    peak = float(np.exp(rng.uniform(*np.log((0.8, 2.2) if wide else (0.2, 1.2)))))
    low = 0.0
    if "tension_only" in effects or (
        not {"slack", "grip_slip"} & set(effects) and rng.random() < 0.2
    ):
        low = -min(rng.uniform(0.1, 0.3), 0.25 / peak)
    quick = {"inertia", "sensor_lag"} & set(effects)
    pace = Pace(
        peak,
        float(np.exp(rng.uniform(*np.log((2.0, 5.0))))),
        float(rng.uniform(0.12, 0.25)),
        float(np.exp(rng.uniform(*np.log((0.5, 1.5) if quick else (0.15, 1.0))))),
        low,
    )
    programmes = draw_programmes(rng, order, pace, quick=bool(quick))
    temperatures = draw_temperatures(rng, programmes)
    continued = bool(rng.random() < 0.25)
    specimens: tuple[str, ...] = ()
    gains = np.ones(len(programmes))
    if not (continued or order.simulated or rng.random() > 0.15):
        number = int(rng.integers(2, 4))
        whose = np.arange(len(programmes)) % number
        if not {"gain_error", "zero_offset"} & set(effects):
            specimens = tuple(f"S{w + 1}" for w in whose)
            gains = (1 + 0.03 * rng.standard_normal(number))[whose]
    setting = Setting(
        model,
        draw_base(rng, peak, True, 0),
        pace,
        programmes,
        temperatures,
        continued,
        tuple(float(g) for g in gains),
        specimens,
        "thermal_softening" in effects or bool(rng.random() < 0.15),
        LEVELS[-1],
    )
    branches = {"hooke": 0, "sls": 1, "pl-sls": 1}.get(model, int(rng.integers(2, 5)))
    while True:
        base = draw_base(rng, peak, not model.startswith("pl-"), branches)
        # A level of its own to every try: a bent spring comes with the louder ones.
        level = float(rng.choice(LEVELS))
        setting = replace(setting, base=base, level=level)
        stress = setting.sampled(setting.bare())
        sigma = setting.level * float(np.ptp(stress))
        # A spring that 16 segments cannot follow would be a mismatch of its own.
        if base.name == "linear" or oracle.adequate(base, programmes, sigma):
            return setting


def draw_programmes(
    rng: np.random.Generator, order: Order, pace: Pace, quick: bool
) -> tuple[Imposed, ...]:
    """About seven programmes in shuffled order, sampled."""
    names = list(FAMILIES)
    if order.seed >= FIRST_TRIAL_SEED:
        replaceable = ["ramp-medium", "growing", "staircase"]
        if not set(NEEDS_SINE) & set(order.effects):
            replaceable.append("sine")
        for old in rng.permutation(replaceable)[: int(rng.integers(1, 4))]:
            names.remove(str(old))
            names.append(str(rng.choice(list(HELD_OUT))))
    if rng.random() < 0.2:
        names.remove(str(rng.choice([n for n in names if n != "sine"])))
    elif rng.random() < 0.2:
        names.append(str(rng.choice(["growing", "staircase", "ramp-medium"])))
    interval = float(
        np.exp(rng.uniform(*np.log((0.02, 0.05) if quick else (0.03, 0.1))))
    )
    clocks = ["jittered", "gappy"] if order.dirty else ["steady", "two-speed"]
    result = []
    for name in rng.permutation(names):
        strain = (FAMILIES | HELD_OUT)[str(name)](rng, pace)
        clock = str(rng.choice(clocks))
        dense = min(interval, 1 / (25 * pace.cycle_hz) if name == "sine" else 1.0)
        samples = int(np.clip(len(strain) * STEP_S / dense, 300, 3000))
        if name == "hold" and clock != "steady":
            samples = int(rng.integers(500, 1500))
        result.append(Imposed(str(name), strain, sample(rng, strain, samples, clock)))
    return tuple(result)


def draw_temperatures(
    rng: np.random.Generator, programmes: Sequence[Imposed]
) -> tuple[Array, ...]:
    """Slow swings within and steps between recordings, 6-15 degC over the case."""
    curves = []
    for p in programmes:
        t = p.time_s
        waves = sum(
            rng.uniform(0.2, 0.5)
            * np.sin(
                2 * np.pi * t / rng.uniform(0.6, 2.5) / t[-1] + rng.uniform(0, 6.3)
            )
            for _ in range(2)
        )
        curves.append(np.asarray(waves) + rng.uniform(-0.7, 0.7))
    low = min(float(c.min()) for c in curves)
    high = max(float(c.max()) for c in curves)
    swing, middle = rng.uniform(6, 15), rng.uniform(20, 27)
    return tuple(middle + swing * ((c - low) / (high - low) - 0.5) for c in curves)


def plant(rng: np.random.Generator, order: Order, setting: Setting) -> list[Planted]:
    """The effects of an order, their sizes measured on the stage before them."""
    context = Context(
        rng,
        order.strength,
        setting.base,
        setting.pace,
        setting.programmes,
        setting.bare(),
    )
    if order.group == "unlisted":
        return [plant_unlisted(rng, order.effects[0], context, setting)]
    planted = [
        make(context)
        for name, make in zip(NAMES, EFFECTS, strict=True)
        if name in order.effects and name not in SENSORS
    ]
    context.stress = setting.run(planted)
    for name, make in zip(NAMES, EFFECTS, strict=True):
        if name in order.effects and name in SENSORS:
            planted.append(make(context))
    return planted


def plant_unlisted(
    rng: np.random.Generator, name: str, context: Context, setting: Setting
) -> Planted:
    """Something else, its multiplier set so that it moves stress by 8-15 % of peak."""
    make = {m.__name__: m for m in UNLISTED}[name]
    goal, state = context.amount(0.08, 0.15), rng.bit_generator.state
    bare = setting.sampled(setting.run(()))
    size = goal
    for _ in range(6):  # nearly linear in size: a few secant steps settle it
        rng.bit_generator.state = state
        planted = make(context, size)
        moved = np.abs(setting.sampled(setting.run([planted])) - bare)
        size = min(size * goal * context.peak / float(moved.max()), 0.6)
    planted.parameters["size"] = size
    planted.parameters["share_of_peak"] = float(moved.max()) / context.peak
    return planted


def draw_case(
    order: Order,
) -> tuple[np.random.Generator, Setting, list[Planted]]:
    """The case and what is planted in it; the generator goes on to the noise."""
    rng = np.random.default_rng([order.seed, order.number])
    setting = draw_setting(rng, order)
    return rng, setting, plant(rng, order, setting)


def forge_case(order: Order) -> Forged:
    """Everything of one case, the same for the same order."""
    rng, setting, planted = draw_case(order)
    fine = setting.run(planted)
    clean, off = setting.sampled(fine), setting.sampled(setting.run(()))
    if not np.isfinite(clean).all():
        raise FloatingPointError(f"{order.name}: the forged stress is not finite")
    peak = float(np.abs(clean).max())
    noise = replace(
        draw_noise(rng, 1.0), sigma_MPa=setting.level * float(np.ptp(clean))
    )
    profile = noise.profile(clean, peak)

    programmes = setting.programmes
    ends = np.cumsum([len(p.index) for p in programmes])
    pieces = list(zip(ends - [len(p.index) for p in programmes], ends, strict=True))
    written, tables = np.zeros_like(clean), {}
    for i, (p, (a, b)) in enumerate(zip(programmes, pieces, strict=True)):
        time = p.time_s[p.index]
        written[a:b] = noise.add(rng, time, clean[a:b], peak)
        table = pd.DataFrame(
            {
                "time_s": time.round(4),
                "strain": p.strain[p.index].round(7),
                "stress_MPa": [float(f"{v:.7g}") for v in written[a:b]],
            }
        )
        if order.dirty:
            for column, share in (("stress_MPa", 0.02), ("strain", 0.005)):
                lost = rng.random(len(table)) < share
                lost[0] = False
                table.loc[lost, column] = np.nan
        if setting.warm:
            reading = setting.temperatures[i][p.index]
            reading = reading + 0.03 * rng.standard_normal(len(time))
            table["temperature_C"] = reading.round(3)
        if order.simulated:
            table["simulated_MPa"] = [float(f"{v:.7g}") for v in off[a:b]]
        tables[f"recording-{i + 1:02d}"] = table

    history = "continued" if setting.continued else "fresh"
    toml = [] if order.simulated else [f'model = "{setting.model}"']
    toml.append(f'history = "{history}"')
    if setting.specimens:
        toml += ["", "[specimen]"]
        toml += [f'{n} = "{s}"' for n, s in zip(tables, setting.specimens, strict=True)]

    base = None if order.simulated else oracle_refit(setting)
    times = [p.time_s[p.index] for p in programmes]
    # The scatter between specimens is never news: it is taken out beforehand.
    scale = np.repeat(setting.gains, [b - a for a, b in pieces])
    left = clean - off
    if base is not None:
        left = scale * oracle.absorb(base, clean / scale, profile / scale)
    effects = {}
    for one in planted:
        without = setting.sampled(setting.run([p for p in planted if p is not one]))
        moved = clean - without
        energy = oracle.visible_energy(
            base,
            off / scale,
            moved / scale,
            times,
            profile / scale,
            noise.correlation_s,
        )
        effects[one.effect] = {
            "form": one.form,
            "parameters": one.parameters,
            "share_of_peak": float(np.abs(moved).max()) / peak,
            "energy": energy,
            "oracle_power": oracle.power(energy, degrees(one)),
            "acts": [runs(np.abs(moved[a:b]) > 2 * profile[a:b]) for a, b in pieces],
        }
    answer = {
        "case": order.name,
        "group": order.group,
        "effects": list(order.effects),
        "strength": order.strength,
        "seed": order.seed,
        "number": order.number,
        "model": None if order.simulated else setting.model,
        "history": history,
        "dirty": order.dirty,
        "simulated": order.simulated,
        "temperature": setting.warm,
        "base": {
            "spring": setting.base.name,
            "modulus_MPa": setting.base.modulus,
            "branches": setting.base.branches,
            "peak_strain": setting.base.peak_strain,
        },
        "noise": {
            "kind": noise.kind,
            "level": setting.level,
            "sigma_MPa": noise.sigma_MPa,
            "correlation_s": noise.correlation_s,
        },
        "noise_nrmse": float(
            np.sqrt(np.sum((written - clean) ** 2) / np.sum(written**2))
        ),
        "planted": effects,
        "acts": [
            runs(np.abs((clean - off)[a:b]) > 2 * profile[a:b]) for a, b in pieces
        ],
        "left": [runs(np.abs(left[a:b]) > 2 * profile[a:b]) for a, b in pieces],
        "left_nrmse": float(np.sqrt(np.sum(left**2) / np.sum(clean**2))),
        "unseen": unseen(order, setting, planted),
        "recordings": [
            {
                "name": name,
                "programme": p.family,
                "samples": len(p.index),
                "gain": gain,
                "clean_MPa": [float(f"{v:.6g}") for v in clean[a:b]],
            }
            for name, p, gain, (a, b) in zip(
                tables, programmes, setting.gains, pieces, strict=True
            )
        ],
    }
    return Forged(tables, "\n".join(toml) + "\n", answer)


def unseen(
    order: Order, setting: Setting, planted: Sequence[Planted]
) -> dict[str, list[float]] | None:
    """One more programme on a virgin specimen, for the corrected model to predict.

    It stays in the key. None where the specimens scatter, or an effect has a size of
    its own in every recording: nobody could predict that.
    """
    if (
        order.group not in ("single", "pair")
        or setting.specimens
        or OWN_SIZE & set(order.effects)
    ):
        return None
    rng = np.random.default_rng([order.seed, order.number, 1])
    strain = zigzag(rng, setting.pace)
    programme = Imposed("zigzag", strain, sample(rng, strain, 600, "steady"))
    seen = np.concatenate(setting.temperatures)
    heat = np.linspace(seen.min(), seen.max(), len(strain))
    alone = replace(
        setting,
        programmes=(programme,),
        temperatures=(heat,),
        continued=False,
        gains=(1.0,),
    )
    columns = {
        "time_s": programme.time_s,
        "strain": strain,
        "clean_MPa": alone.run(planted)[0],
    }
    if setting.warm:
        columns["temperature_C"] = heat
    if order.simulated:
        columns["simulated_MPa"] = alone.run(())[0]
    return {
        name: [float(f"{v:.7g}") for v in values[programme.index]]
        for name, values in columns.items()
    }


def degrees(planted: Planted) -> int:
    """Free parameters of an effect for the oracle: one, or one a recording."""
    lists = [v for v in planted.parameters.values() if isinstance(v, dict | list)]
    return max([1, *(len(v) for v in lists)])


def oracle_refit(
    setting: Setting, times_s: Sequence[float] | None = None
) -> oracle.Refit:
    """What the named model can choose from, knowing the history before a recording.

    `times_s`: relaxation times offered beside the grid, by default the true ones.
    """
    before: list[Array] = []
    past = np.zeros(0)
    for strain in specimen_strains((), setting.programmes):
        before.append(past)
        if setting.continued:
            past = np.concatenate([past, strain])
    times = [t for _, t in setting.base.branches] if times_s is None else times_s
    return oracle.refit(setting.model, setting.programmes, before, times)


def runs(mask: np.ndarray) -> list[list[int]]:
    """A mask as [start, end) pairs of sample numbers.

    >>> runs(np.array([False, True, True, False, True]))
    [[1, 3], [4, 5]]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [[int(a), int(b)] for a, b in edges.reshape(-1, 2)]


def plan(
    seed: int,
    strength: float,
    *,
    each: int,
    nulls: int,
    pairs: int,
    unlisted: int,
    only: Sequence[str] = (),
    dirty: float = 0.15,
    simulated: float = 0.1,
) -> list[Order]:
    """Orders of a trial, shuffled; `dirty` and `simulated` are shares of the cases."""
    rng = np.random.default_rng([seed, 2**32 - 1])
    kinds: list[tuple[str, tuple[str, ...]]] = []
    for name in only or NAMES:
        kinds += [("single", (name,))] * each
    kinds += [("null", ())] * nulls
    allowed = [
        two
        for two in itertools.combinations(NAMES, 2)
        if not any(set(two) == bad for bad in NOT_TOGETHER)
    ]
    drawn = rng.permutation(len(allowed))
    kinds += [("pair", allowed[drawn[i % len(allowed)]]) for i in range(pairs)]
    others = [m.__name__ for m in UNLISTED]
    kinds += [("unlisted", (others[i % len(others)],)) for i in range(unlisted)]
    orders = []
    for number, k in enumerate(rng.permutation(len(kinds))):
        group, effects = kinds[k]
        orders.append(
            Order(
                f"case-{number + 1:04d}",
                group,
                effects,
                strength,
                seed,
                number,
                bool(rng.random() < dirty),
                bool(rng.random() < simulated),
            )
        )
    return orders


def write_case(order: Order, cases: Path) -> dict[str, Any]:
    """Forge one case, write what may be seen, hand back the answer."""
    forged = forge_case(order)
    folder = cases / order.name / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in forged.tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    (cases / order.name / "case.toml").write_text(forged.toml)
    return forged.answer


def forge(orders: Sequence[Order], directory: Path, jobs: int = 1) -> str:
    """Write `directory`/cases and the sealed key beside it; the key's SHA-256.

    `directory`/seal.json holds the hash and what was ordered in numbers only.
    """
    cases = directory / "cases"
    cases.mkdir(parents=True, exist_ok=True)
    if any(cases.iterdir()):
        raise FileExistsError(f"{cases} is not empty; forge into a new folder")
    folders = [cases] * len(orders)
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            answers = list(pool.map(write_case, orders, folders, chunksize=4))
    else:
        answers = [write_case(o, f) for o, f in zip(orders, folders, strict=True)]
    key = gzip.compress(json.dumps(answers, default=plain).encode(), mtime=0)
    sealed = directory / "sealed"
    sealed.mkdir(exist_ok=True)
    (sealed / "key.json.gz").write_bytes(key)
    digest = hashlib.sha256(key).hexdigest()
    seal = {"key_sha256": digest, "cases": len(orders)}
    (directory / "seal.json").write_text(json.dumps(seal, indent=1) + "\n")
    return digest


def open_key(directory: Path) -> list[dict[str, Any]]:
    """Answers of a forged folder; refused when the key is not the one sealed."""
    data = (directory / "sealed" / "key.json.gz").read_bytes()
    stated = json.loads((directory / "seal.json").read_text())["key_sha256"]
    found = hashlib.sha256(data).hexdigest()
    if found != stated:
        raise ValueError(f"the key has SHA-256 {found}, sealed was {stated}")
    return json.loads(gzip.decompress(data))


def plain(value: Any) -> Any:
    """NumPy scalars and arrays for JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not for JSON")
