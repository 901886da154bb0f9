"""Common parts of the C of all models: options, texts, struct."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softnn.contracts import InputError

DEEPEST = 8  # models that correct models
LARGEST = 1_000_000  # samples a delay may hold
UNSTEPPED = {
    "inertia": "acceleration needs the next sample",
    "learned": "its features need the whole recording",
}


@dataclass(frozen=True)
class Options:
    """Options of an export.

    `recording` names the recording whose own values are used; None turns them off.
    `leave_out` names parts that cannot be stepped and may be missing. `interval_s` is
    the shortest time between samples, for which delays are made.
    """

    recording: str | None = None
    leave_out: tuple[str, ...] = ()
    interval_s: float = 1e-3

    def capacity(self, longest_s: float) -> int:
        """Samples to be kept so that one of `longest_s` ago is among them."""
        if not (np.isfinite(self.interval_s) and self.interval_s > 0):
            raise InputError(f"interval is {self.interval_s} s; it must be above 0")
        samples = int(min(np.ceil(longest_s / self.interval_s), 1e12)) + 3
        if samples > LARGEST:
            raise InputError(
                f"a delay of {longest_s:.6g} s holds {samples} samples of "
                f"{self.interval_s:.6g} s; at most {LARGEST}, give a longer --interval"
            )
        return samples


@dataclass
class Instance:
    """C of one model: texts that `softnn.export.source` puts together."""

    prefix: str
    types: list[str] = field(default_factory=list)
    functions: list[str] = field(default_factory=list)
    needs_simulated: bool = False
    needs_temperature: bool = False
    is_network: bool = False
    notes: list[str] = field(default_factory=list)


def struct_of(prefix: str, members: list[str]) -> str:
    inside = "".join(f"    {m}\n" for m in members or ["char unused;"])
    return f"typedef struct {{\n{inside}}} {prefix}_t;\n"
