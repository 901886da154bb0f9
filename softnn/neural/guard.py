"""The training range of a network, and flags for inputs outside it.

A network answers any input; outside its training range the answer means nothing. Each
sample is checked for three things: strain, rate, and the direction of straining.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, InputError
from softnn.neural.inputs import strain_rate
from softnn.recording import Recording

STRAIN, RATE, DIRECTION = 1, 2, 4  # bits of a flag; the exports use the same
WORDS = {STRAIN: "strain", RATE: "rate", DIRECTION: "direction"}
SLACK = 0.01  # of a range; an input may lie so far outside
COMMON = 0.005  # share of the rates at either end that may be noise of the strain


@dataclass(frozen=True)
class Seen:
    """Ranges (low, high) of strain and, if known, of strain rate [1/s] in training.

    `rates` are the ranges of single recordings, without training between them; None if
    they are unknown.
    """

    strain: tuple[float, float]
    rate_per_s: tuple[float, float] | None = None
    rates: tuple[tuple[float, float], ...] | None = None

    @classmethod
    def of(cls, recordings: Sequence[Recording], lag_s: float | None = None) -> Seen:
        """Return the ranges of recordings; tensile tests have their nominal rates."""
        own = []
        for r in recordings:
            rate = strain_rate(r, lag_s)
            low, high = np.quantile(rate[np.isfinite(rate)], [COMMON, 1 - COMMON])
            own.append((float(low), float(high)))
        rates = tuple(sorted(set(own)))
        strain = np.concatenate([r.strain[np.isfinite(r.strain)] for r in recordings])
        whole = min(low for low, _ in rates), max(high for _, high in rates)
        return cls((float(strain.min()), float(strain.max())), whole, rates)

    def flags(self, strain: Array, rate_per_s: Array) -> NDArray[np.uint8]:
        """Bits (n,) for samples of strain and rate (n,); nan in a rate is not judged.

        >>> seen = Seen((0.0, 0.5), (0.01, 0.1))
        >>> seen.flags(np.array([0.2, 0.6, 0.2]), np.array([0.05, 0.3, -0.05])).tolist()
        [0, 3, 4]
        """
        out = np.where(_beyond(strain, *self.strain), STRAIN, 0)
        if self.rate_per_s is not None:
            low, high = self.rate_per_s
            down, up = (rate_per_s < 0) & (low >= 0), (rate_per_s > 0) & (high <= 0)
            other = down | up
            far = _beyond(rate_per_s, low, high) & ~other
            out = out | np.where(other, DIRECTION, 0) | np.where(far, RATE, 0)
        return out.astype(np.uint8)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready; `from_dict` takes it back."""
        rate = None if self.rate_per_s is None else list(self.rate_per_s)
        out: dict[str, Any] = {"strain": list(self.strain), "rate_per_s": rate}
        if self.rates is not None:
            out["rates"] = [list(pair) for pair in self.rates]
        return out

    @classmethod
    def from_dict(cls, given: Any) -> Seen:
        """Return the ranges of a file. Raises `InputError` if it has none."""
        try:
            rate, own = given["rate_per_s"], given.get("rates")
            pairs = [given["strain"], *([] if rate is None else [rate]), *(own or [])]
            ranges = [(float(low), float(high)) for low, high in pairs]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"seen is no pair of ranges: {error!r}") from None
        if not all(low <= high for low, high in ranges):
            raise InputError(f"seen is {pairs}; each range is low, high")
        rates = None if own is None else tuple(ranges[len(ranges) - len(own) :])
        return cls(ranges[0], None if rate is None else ranges[1], rates)


def _beyond(values: Array, low: float, high: float) -> NDArray[np.bool]:
    slack = SLACK * (high - low)
    return (values < low - slack) | (values > high + slack)


def counted(flags: NDArray[np.uint8]) -> Mapping[str, int]:
    """Return how many samples are outside, in all and by kind.

    >>> counted(np.array([0, 3, 4, 4], np.uint8))
    {'samples': 4, 'outside': 3, 'strain': 1, 'rate': 1, 'direction': 2}
    """
    found = {word: int(np.sum(flags & bit > 0)) for bit, word in WORDS.items()}
    return {"samples": len(flags), "outside": int(np.sum(flags > 0))} | found
