"""A concealed case: drawn from a seed, run on the fine clock, its answer beside it.

Names of cases and recordings say nothing, and their order is shuffled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from bench.concealed import oracle
from bench.concealed.noises import Noise, draw_noise, of_colour
from bench.concealed.orders import EFFECTS, NAMES, OWN_SIZE, SENSORS, Order
from bench.concealed.planting import Context, Planted
from bench.concealed.programmes import Array, Imposed, sample, zigzag
from bench.concealed.settings import Setting, draw_setting
from bench.concealed.unlisted import UNLISTED


@dataclass(frozen=True)
class Forged:
    """One case: tables to be written, the public toml, and the answer."""

    tables: dict[str, pd.DataFrame]
    toml: str
    answer: dict[str, Any]


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
    clean, off = setting.sampled(setting.run(planted)), setting.sampled(setting.run(()))
    if not np.isfinite(clean).all():
        raise FloatingPointError(f"{order.name}: the forged stress is not finite")
    noise = draw_noise(rng, 1.0)
    if order.correlation_s is not None:
        noise = of_colour(order.correlation_s)
    noise = replace(noise, sigma_MPa=setting.level * float(np.ptp(clean)))
    tables = write_down(rng, order, setting, noise, clean, off)
    written = np.concatenate([t["stress_MPa"].to_numpy() for t in tables.values()])
    if order.dirty:
        tables = {name: soiled(rng, table) for name, table in tables.items()}
    history = "continued" if setting.continued else "fresh"
    toml = [] if order.simulated else [f'model = "{setting.model}"']
    toml.append(f'history = "{history}"')
    if setting.specimens:
        toml += ["", "[specimen]"]
        toml += [f'{n} = "{s}"' for n, s in zip(tables, setting.specimens, strict=True)]
    base = setting.base
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
            "spring": base.name,
            "modulus_MPa": base.modulus,
            "branches": base.branches,
            "peak_strain": base.peak_strain,
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
        **traces(order, setting, planted, noise, clean, off),
        "unseen": unseen(order, setting, planted),
        "recordings": [
            {
                "name": name,
                "programme": programme.family,
                "samples": len(programme.index),
                "gain": gain,
                "clean_MPa": [float(f"{v:.6g}") for v in part],
            }
            for name, programme, gain, part in zip(
                tables,
                setting.programmes,
                setting.gains,
                by_recording(setting, clean),
                strict=True,
            )
        ],
    }
    if order.prescribed:
        answer["prescribed"] = order.prescribed
    return Forged(tables, "\n".join(toml) + "\n", answer)


def by_recording(setting: Setting, values: np.ndarray) -> list[np.ndarray]:
    """Samples of all recordings (n,), one array a recording."""
    ends = np.cumsum([len(p.index) for p in setting.programmes])
    return np.split(values, ends[:-1])


def write_down(
    rng: np.random.Generator,
    order: Order,
    setting: Setting,
    noise: Noise,
    clean: Array,
    off: Array,
) -> dict[str, pd.DataFrame]:
    """The recordings as tables, with noise; nothing is missing yet."""
    peak, tables = float(np.abs(clean).max()), {}
    parts = zip(
        setting.programmes,
        setting.temperatures,
        by_recording(setting, clean),
        by_recording(setting, off),
        strict=True,
    )
    for i, (p, heat, stress, simulated) in enumerate(parts):
        time = p.time_s[p.index]
        written = noise.add(rng, time, stress, peak)
        table = pd.DataFrame(
            {
                "time_s": time.round(4),
                "strain": p.strain[p.index].round(7),
                "stress_MPa": [float(f"{v:.7g}") for v in written],
            }
        )
        if setting.warm:
            reading = heat[p.index] + 0.03 * rng.standard_normal(len(time))
            table["temperature_C"] = reading.round(3)
        if order.simulated:
            table["simulated_MPa"] = [float(f"{v:.7g}") for v in simulated]
        tables[f"recording-{i + 1:02d}"] = table
    return tables


def soiled(rng: np.random.Generator, table: pd.DataFrame) -> pd.DataFrame:
    """A table with values missing here and there; the first sample is whole."""
    table = table.copy()
    for column, share in (("stress_MPa", 0.02), ("strain", 0.005)):
        lost = rng.random(len(table)) < share
        lost[0] = False
        table.loc[lost, column] = np.nan
    return table


def traces(
    order: Order,
    setting: Setting,
    planted: Sequence[Planted],
    noise: Noise,
    clean: Array,
    off: Array,
) -> dict[str, Any]:
    """Where the effects act by more than two noise sigmas, and whether it can be seen.

    "acts": against the same case without them; "left": what a refit of the base leaves.
    """
    peak = float(np.abs(clean).max())
    profile = noise.profile(clean, peak)

    def where(moved: Array) -> list[list[list[int]]]:
        return [runs(m) for m in by_recording(setting, np.abs(moved) > 2 * profile)]

    base = None if order.simulated else setting.refit()
    # The scatter between specimens is never news: it is taken out beforehand.
    scale = np.repeat(setting.gains, [len(p.index) for p in setting.programmes])
    left = clean - off
    if base is not None:
        left = scale * oracle.absorb(base, clean / scale, profile / scale)
    time_s = [p.time_s[p.index] for p in setting.programmes]
    does = [
        clean - setting.sampled(setting.run([p for p in planted if p is not one]))
        for one in planted
    ]

    def visible(able: oracle.Refit | None, moved: Array) -> float:
        return oracle.visible_energy(
            able, off / scale, moved, time_s, profile / scale, noise.correlation_s
        )

    effects = {}
    for one, moved in zip(planted, does, strict=True):
        energy = visible(base, moved / scale)
        # Beside others whose law nobody tells: what no form of theirs makes up.
        others = [m / scale for m in does if m is not moved]
        beside = visible(oracle.bent(base, others, setting.programmes), moved / scale)
        effects[one.effect] = {
            "form": one.form,
            "parameters": one.parameters,
            "share_of_peak": float(np.abs(moved).max()) / peak,
            "energy": energy,
            "oracle_power": oracle.power(energy, degrees(one)),
            "energy_beside": beside,
            "power_beside": oracle.power(beside, degrees(one)),
            "acts": where(moved),
        }
    return {
        "planted": effects,
        "acts": where(clean - off),
        "left": where(left),
        "left_nrmse": float(np.sqrt(np.sum(left**2) / np.sum(clean**2))),
    }


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


def runs(mask: np.ndarray) -> list[list[int]]:
    """A mask as [start, end) pairs of sample numbers.

    >>> runs(np.array([False, True, True, False, True]))
    [[1, 3], [4, 5]]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [[int(a), int(b)] for a, b in edges.reshape(-1, 2)]
