"""A trained network: numbers in, stress out. It needs NumPy alone."""

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

    def at(self, asked: np.ndarray, inputs: Array, recording: np.ndarray) -> Array:
        """Stress of the samples in `asked` (n,); `recording` (n,) says whose they are.

        inputs (n, d) are those of all samples: a network with a memory needs them.
        """
        return self.predict(inputs[asked])

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
class RecurrentNetwork(Network):
    r"""Gated recurrent units from sample to sample, and a linear output.

    .. math:: r_i, z_i = s(W_{r,z} x_i + U_{r,z} h_{i-1}), \quad
              n_i = \tanh(W_n x_i + r_i U_n h_{i-1}), \quad
              h_i = z_i h_{i-1} + (1 - z_i) n_i

    hidden (s, d + 1): W_n and, last, its bias; gates (2 s, d + 1): those of r and z;
    past (3 s, s): U of r, z and n. A recording begins at h = 0; inputs are samples of
    one recording, in order. Cho et al. (2014), doi:10.3115/v1/D14-1179.
    """

    gates: Array
    past: Array

    def at(self, asked: np.ndarray, inputs: Array, recording: np.ndarray) -> Array:
        out = np.empty(len(inputs))
        for one in np.unique(recording[asked]):
            mine = recording == one
            out[mine] = self.predict(inputs[mine])
        return out[asked]

    def layer(self, inputs: Array) -> Array:
        x = self.inputs.apply(np.asarray(inputs, float))
        weights = np.concatenate([self.gates, self.hidden])
        driven = x @ weights[:, :-1].T + weights[:, -1]
        size = len(self.hidden)
        state, states = np.zeros(size), np.empty((len(x), size))
        for i, now in enumerate(driven):
            before = self.past @ state
            reset, keep = np.split(
                1 / (1 + np.exp(-now[: 2 * size] - before[: 2 * size])), 2
            )
            new = np.tanh(now[2 * size :] + reset * before[2 * size :])
            state = states[i] = keep * state + (1 - keep) * new
        return states

    def to_dict(self) -> dict[str, Any]:
        memory = {"gates": self.gates.tolist(), "past": self.past.tolist()}
        return super().to_dict() | memory

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> Self:
        plain = Network.from_dict(given)
        try:
            gates, past = (np.asarray(given[k], float) for k in ("gates", "past"))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a recurrent network: {error!r}") from None
        size, width = plain.hidden.shape
        wanted = (2 * size, width), (3 * size, size)
        if (gates.shape, past.shape) != wanted or not (
            np.isfinite(gates).all() and np.isfinite(past).all()
        ):
            raise InputError(
                f"not a recurrent network: gates {gates.shape}, past {past.shape}; "
                f"needed {wanted[0]}, {wanted[1]}, all finite"
            )
        return cls(**vars(plain), gates=gates, past=past)


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
