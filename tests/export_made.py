"""Models to export, and their C compiled: for the tests of exports."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np

from softnn.contracts import Chunk, Scales
from softnn.export.source import c_source
from softnn.fit import Piece
from softnn.model_file import Stored
from softnn.models.units import build
from softnn.neural import Scaling, StoredNetwork, architecture_of

STRICT = ["-std=c99", "-O2", "-pedantic", "-Wall", "-Wextra", "-Werror"]
SCALES = Scales(0.6, 2.0, 1e-3, np.array([35.0]), 5.0, 5.0)


class Compiled:
    """A model's C, compiled strictly and loaded: `run` steps through a history."""

    def __init__(self, folder: Path, model, name="model", options=None):
        for text, ending in zip(c_source(model, name, options), "hc", strict=True):
            (folder / f"{name}.{ending}").write_text(text, encoding="ascii")
        (folder / "size.c").write_text(
            f'#include "{name}.h"\n'
            "unsigned long size(void);\nunsigned flags(const void *s);\n"
            f"unsigned long size(void) {{ return sizeof({name}_state); }}\n"
            "unsigned flags(const void *s)\n"
            f"{{ return ((const {name}_state *)s)->flags; }}\n"
        )
        path = folder / "model.so"
        files = [folder / f"{name}.c", folder / "size.c"]
        subprocess.run(
            ["gcc", *STRICT, "-shared", "-fPIC", "-o", path, *files, "-lm"], check=True
        )
        library = ctypes.CDLL(str(path))
        library.size.restype = ctypes.c_ulong
        library.flags.argtypes = [ctypes.c_void_p]
        self.flags = library.flags
        self.step = library[f"{name}_step"]
        self.step.restype = ctypes.c_double
        self.step.argtypes = [ctypes.c_void_p] + [ctypes.c_double] * 4
        self.state = ctypes.create_string_buffer(library.size())
        self.place = ctypes.addressof(self.state)
        start = library[f"{name}_init"]
        start.argtypes = [ctypes.c_void_p]
        start(self.place)

    def run(self, chunk, simulated=None):
        nothing = np.full(len(chunk.time_s), np.nan)
        warm = nothing if chunk.temperature_C is None else chunk.temperature_C
        given = nothing if simulated is None else simulated
        steps = np.diff(chunk.time_s, prepend=chunk.time_s[0])
        stress, flags = [], []
        for row in zip(steps, chunk.strain, warm, given, strict=True):
            stress.append(self.step(self.place, *row))
            flags.append(self.flags(self.place))
        return np.array(stress), np.array(flags)


def history(n=20_000, seed=0, low=-0.15):
    """Irregular time with a stamp repeated, strain of both signs, a temperature."""
    rng = np.random.default_rng(seed)
    time = 3.0 + np.cumsum(rng.uniform(5e-4, 3e-3, n))
    time[100] = time[99]
    wave = 0.5 - 0.5 * np.cos(2 * time) * np.cos(0.37 * time)
    warm = 23 + 5 * np.sin(time)
    warm[5:50] = np.nan
    return Chunk(time, low + (0.6 - low) * wave, warm)


def base(branches_a_decade=2):
    units = build("pl-wiechert", -0.2, 0.6, 1e-3, 35.0, 16, branches_a_decade)
    stiffness = np.random.default_rng(1).uniform(0, 2, units.columns)
    stiffness[[3, -2]] = 0
    return units, stiffness


def with_effects(*pieces, needs=False, **more):
    own = tuple({k: {"r": p.values[k]} for k in p.effect.per_recording} for p in pieces)
    return Stored(*base(), pieces, own, needs, "fresh", **more)


def piece(law, start=0):
    values = law.starts(SCALES)[start]
    own = {k: float(np.ravel(v)[0]) for k, v in values.items()}
    return Piece(law, law.defaults() | own, ())


def memory(neurons, width, rng):
    """Weights that recurrent units have beside those of others."""
    shapes = {"gates": (2 * neurons, width + 1), "past": (3 * neurons, neurons)}
    return {name: rng.normal(size=shape) for name, shape in shapes.items()}


def network(architecture="FFRD4", lag_s=None, seen=None, neurons=17):
    row = architecture_of(architecture)
    width = row.width
    rng = np.random.default_rng(5)
    low, high = np.zeros(width), np.full(width, 0.5)
    if architecture == "FFRD4":
        low[1], high[1] = 0.02, 0.25
    scaling = Scaling(low, high), Scaling(np.array(0.0), np.array(3.0))
    net = row.network(
        rng.normal(size=(neurons, width + 1)),
        rng.normal(size=neurons + 1),
        *scaling,
        **memory(neurons, width, rng) if row.recurrent else {},
    )
    return StoredNetwork(net, architecture, lag_s, seen)
