"""A trained network as a file: any machine with NumPy gets stress from it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from softnn import glance
from softnn.axes import SPECIMEN
from softnn.contracts import Array, Chunk, InputError
from softnn.neural.fitting import run
from softnn.neural.guard import Seen, counted
from softnn.neural.inputs import architecture_of, strain_rate
from softnn.neural.network import Network
from softnn.recording import Recording, history_of

KIND = "softnn-network"
VERSION = 1


@dataclass(frozen=True, repr=False)
class StoredNetwork:
    """A network with the inputs it wants: stress of a strain history.

    `lag_s` is the lag time of its inputs, None for one sampling step of a recording.
    `seen` is what it was trained on; an older file has only the ranges of its inputs.
    """

    network: Network
    architecture: str
    lag_s: float | None = None
    seen: Seen | None = None
    needs_simulated = False
    axes = SPECIMEN

    def __repr__(self) -> str:
        count = len(self.network.hidden)
        low, high = self.known.strain
        return (
            f"<Network {self.architecture} of {count} neuron{'s'[: count != 1]}, "
            f"trained at strains of {low:.3g} to {high:.3g}>"
        )

    def _repr_html_(self) -> str:
        return glance.model_html(self, max(self.known.strain, key=abs))

    @property
    def source(self) -> dict[str, Any]:
        """The network as its file holds it."""
        return {
            "kind": KIND,
            "version": VERSION,
            "architecture": self.architecture,
            "lag_s": self.lag_s,
            "network": self.network.to_dict(),
            "seen": None if self.seen is None else self.seen.to_dict(),
        }

    @property
    def known(self) -> Seen:
        """Strains and rates of the training, as far as the file tells them."""
        if self.seen is not None:
            return self.seen
        low, high = self.network.inputs.low, self.network.inputs.high
        row = architecture_of(self.architecture)
        at = len(row.lags)
        return Seen(
            (float(low[0]), float(high[0])),
            (float(low[at]), float(high[at])) if row.rate else None,
        )

    def outside(self, chunk: Chunk) -> npt.NDArray[np.uint8]:
        """For each sample (n,) whether it is asked what it was never shown.

        Bits of `softnn.neural.guard`. The rate is that of the network's own input, a
        backward difference; the first sample has none.
        """
        rate = np.full(len(chunk.time_s), np.nan)
        if len(np.unique(chunk.time_s)) > 1:
            plain = Recording(chunk.time_s, chunk.strain, np.zeros(len(chunk.strain)))
            rate = strain_rate(plain, self.lag_s)
            rate[chunk.time_s == chunk.time_s[0]] = np.nan
        return self.known.flags(np.asarray(chunk.strain, float), rate)

    def simulate(
        self, history: Recording | npt.ArrayLike, strain: npt.ArrayLike | None = None
    ) -> Array:
        """Stress (n,) over a strain history, MPa.

        `history` is a recording, whose own stress is not used, or times (n,) [s] with
        `strain` (n,). Warns where the history leaves what the network was trained on.
        """
        name, chunk = history_of(history, strain)
        out = counted(self.outside(chunk))
        if out["outside"]:
            kinds = ", ".join(f"{k} {n}" for k, n in out.items() if n)
            warnings.warn(
                f"{name}: samples that the network was never shown ({kinds})",
                stacklevel=2,
            )
        return self.stress([name], [chunk], [None])[0]

    def stress(
        self,
        names: Sequence[str],
        chunks: Sequence[Chunk],
        simulated: Sequence[Array | None],
        continued: bool | None = None,
    ) -> list[Array]:
        """Stress (n,) of each history, MPa; a network knows nothing of earlier ones."""
        out = []
        for name, chunk in zip(names, chunks, strict=True):
            plain = Recording(
                chunk.time_s, chunk.strain, np.zeros(len(chunk.strain)), name=name
            )
            if not np.isfinite(plain.strain).all():
                raise InputError(f"{name}: a network needs strain at every sample")
            out += run(self.network, self.architecture, [plain], self.lag_s)
        return out


def from_dict(given: Mapping[str, Any]) -> StoredNetwork:
    """The network of a file's content; `InputError` for a bad one."""
    if given.get("kind") != KIND or given.get("version") != VERSION:
        raise InputError(
            f"not a network of softnn: kind {given.get('kind')!r}, version "
            f"{given.get('version')!r}; needed {KIND!r}, {VERSION}"
        )
    architecture = str(given.get("architecture"))
    row = architecture_of(architecture)
    inner = given.get("network")
    if not isinstance(inner, Mapping):
        raise InputError("the file has no network in it")
    network = row.network.from_dict(inner)
    wanted, found = row.width, network.hidden.shape[1] - 1
    if wanted != found:
        raise InputError(f"{architecture} has {wanted} inputs; the network has {found}")
    lag = given.get("lag_s")
    if lag is not None and not (isinstance(lag, int | float) and 0 < lag < np.inf):
        raise InputError(f"lag_s is {lag!r}; it must be above 0, or null")
    seen = given.get("seen")
    return StoredNetwork(
        network, architecture, lag, None if seen is None else Seen.from_dict(seen)
    )
