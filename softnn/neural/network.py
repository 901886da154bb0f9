"""A trained network: numbers in, stress out. NumPy only, so that it runs anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from softnn.contracts import Array, InputError


@dataclass(frozen=True)
class Scaling:
    """Min-max normalisation to [-1, 1], column by column; a constant becomes 0."""

    low: Array
    high: Array

    @classmethod
    def of(cls, values: Array) -> Scaling:
        return cls(values.min(axis=0), values.max(axis=0))

    @property
    def half(self) -> Array:
        half = (self.high - self.low) / 2
        return np.where(half > 0, half, 1.0)

    def apply(self, values: Array) -> Array:
        return (values - (self.low + self.high) / 2) / self.half

    def undo(self, values: Array) -> Array:
        return values * self.half + (self.low + self.high) / 2


@dataclass(frozen=True)
class Network:
    r"""One hidden layer of tanh neurons and a linear output (thesis eq. 6.3).

    .. math:: h = w_2 \tanh(W_1 x + b_1) + b_2

    hidden (s, d + 1): W_1 and, last, b_1; output (s + 1,): w_2 and, last, b_2; both
    act on normalised inputs and give a normalised output.
    """

    hidden: Array
    output: Array
    inputs: Scaling
    target: Scaling

    def predict(self, inputs: Array) -> Array:
        """Stress (n,) in MPa for inputs (n, d) in their own units."""
        layer = self.layer(inputs)
        return self.target.undo(layer @ self.output[:-1] + self.output[-1])

    def layer(self, inputs: Array) -> Array:
        """What the hidden neurons say (n, s) to inputs (n, d) in their own units."""
        x = self.inputs.apply(np.asarray(inputs, float))
        return np.tanh(x @ self.hidden[:, :-1].T + self.hidden[:, -1])

    def to_dict(self) -> dict[str, Any]:
        """A JSON-ready dictionary; `from_dict` takes it back exactly."""
        return {
            "hidden": self.hidden.tolist(),
            "output": self.output.tolist(),
            "inputs": {k: v.tolist() for k, v in asdict(self.inputs).items()},
            "target": {k: float(v) for k, v in asdict(self.target).items()},
        }

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> Self:
        """The network of a dictionary from `to_dict`; `InputError` for a bad one."""
        try:
            hidden = np.asarray(given["hidden"], float)
            output = np.asarray(given["output"], float)
            inputs, target = (
                Scaling(*(np.asarray(given[k][end], float) for end in ("low", "high")))
                for k in ("inputs", "target")
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a network: {error!r}") from None
        fits = (
            hidden.ndim == 2
            and output.shape == (len(hidden) + 1,)
            and inputs.low.shape == inputs.high.shape == (hidden.shape[1] - 1,)
            and target.low.shape == target.high.shape == ()
            and all(np.isfinite(a).all() for a in (hidden, output))
        )
        if not fits:
            raise InputError(
                f"not a network: hidden {hidden.shape}, output {output.shape}, inputs "
                f"{inputs.low.shape}; needed (s, d + 1), (s + 1,), (d,), all finite"
            )
        return cls(hidden, output, inputs, target)


@dataclass(frozen=True)
class RadialNetwork(Network):
    r"""One hidden layer of Gaussian units and a linear output.

    .. math:: h = w_2 \exp(-|x - c|^2 / 2 w^2) + b_2

    hidden (s, d + 1): the centres c and, last, their width w; the rest as in `Network`.
    Broomhead and Lowe (1988), Complex Systems 2, 321.
    """

    def layer(self, inputs: Array) -> Array:
        x = self.inputs.apply(np.asarray(inputs, float))
        away = x[:, None, :] - self.hidden[None, :, :-1]
        return np.exp(-0.5 * (away**2).sum(axis=2) / self.hidden[:, -1] ** 2)


@dataclass(frozen=True)
class BoundedNetwork(Network):
    """The same, its inputs held within those of the training, its stress of one sign.

    What hangs loose bears nothing: no stress has another sign than most of the range of
    the training. Asked beyond its training it answers as at the edge of it.
    """

    @property
    def pulls(self) -> bool:
        """Whether its stress is never below zero; else it is never above."""
        return bool(self.target.low + self.target.high >= 0)

    def predict(self, inputs: Array) -> Array:
        known = np.clip(np.asarray(inputs, float), self.inputs.low, self.inputs.high)
        stress = super().predict(known)
        return np.maximum(stress, 0.0) if self.pulls else np.minimum(stress, 0.0)
