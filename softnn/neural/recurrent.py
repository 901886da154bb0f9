r"""A small recurrent network: what it knows of the past it has to learn to keep.

.. math:: h_i = \mathrm{GRU}(\varepsilon_i, h_{i-1}), \quad \sigma_i = w h_i + b

Gated recurrent units (Cho et al. 2014, doi:10.3115/v1/D14-1179) over strain at equal
steps of time: another step is another network, so histories are first brought to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from softnn.contracts import Array, InputError
from softnn.neural.network import Scaling
from softnn.recording import Recording

RATE = 0.02  # of Adam, at first; it falls to nothing along a cosine
MOST_NORM = 1.0  # of a gradient


@dataclass(frozen=True)
class Recurrent:
    """A trained one: units, time step [s] and scales of strain and stress."""

    cell: nn.GRU
    out: nn.Linear
    step_s: float
    strain: Scaling
    stress: Scaling

    @property
    def parameters(self) -> int:
        """Weights in all."""
        every = [*self.cell.parameters(), *self.out.parameters()]
        return sum(p.numel() for p in every)

    def predict(self, recording: Recording) -> Array:
        """Stress (n,) in MPa of a recording; its own stress is not used."""
        time, strain = _even(recording, recording.strain, self.step_s)
        x = torch.from_numpy(self.strain.apply(strain))[None, :, None]
        with torch.no_grad():
            y = self.out(self.cell(x)[0])[0, :, 0].numpy()
        return np.interp(recording.time_s, time, self.stress.undo(y))


def train_recurrent(
    recordings: Sequence[Recording],
    *,
    units: int,
    step_s: float,
    epochs: int,
    seed: int,
) -> Recurrent:
    """A network on whole histories, all of them in each of `epochs` steps of Adam.

    Raises `InputError` for what cannot be trained on.
    """
    if not recordings or units < 1 or epochs < 1 or not step_s > 0:
        raise InputError(
            f"{len(recordings)} recordings, {units} units, {epochs} epochs, a step of "
            f"{step_s} s; all must be above 0"
        )
    rows = [
        (_even(r, r.strain, step_s)[1], _even(r, r.stress_MPa, step_s)[1])
        for r in recordings
    ]
    strain, stress = (
        Scaling.of(np.concatenate([pair[k] for pair in rows])) for k in (0, 1)
    )
    x, y, weight = _stacked([(strain.apply(e), stress.apply(s)) for e, s in rows])
    generator = torch.random.get_rng_state()
    torch.manual_seed(seed)
    cell = nn.GRU(1, units, batch_first=True, dtype=torch.float64)
    out = nn.Linear(units, 1, dtype=torch.float64)
    torch.random.set_rng_state(generator)
    free = [*cell.parameters(), *out.parameters()]
    adam = torch.optim.Adam(free, lr=RATE)
    slower = torch.optim.lr_scheduler.CosineAnnealingLR(adam, epochs)
    for _ in range(epochs):
        adam.zero_grad()
        error = out(cell(x)[0])[:, :, 0] - y
        loss = (weight * error * error).sum() / weight.sum()
        loss.backward()
        nn.utils.clip_grad_norm_(free, MOST_NORM)
        adam.step()
        slower.step()
    return Recurrent(cell, out, step_s, strain, stress)


def _even(recording: Recording, values: Array, step_s: float) -> tuple[Array, Array]:
    """Times and values at equal steps from the first sample to beyond the last."""
    good = np.isfinite(values) & np.isfinite(recording.strain)
    first, last = recording.time_s[0], recording.time_s[-1]
    time = first + step_s * np.arange(int(np.ceil((last - first) / step_s)) + 1)
    return time, np.interp(time, recording.time_s[good], values[good])


def _stacked(rows: Sequence[tuple[Array, Array]]) -> tuple[Tensor, Tensor, Tensor]:
    """x (m, n, 1), y and weight (m, n): shorter histories are filled with weight 0."""
    most = max(len(e) for e, _ in rows)
    x, y, weight = (np.zeros((len(rows), most)) for _ in range(3))
    for i, (e, s) in enumerate(rows):
        x[i, : len(e)], y[i, : len(e)], weight[i, : len(e)] = e, s, 1
    return (
        torch.from_numpy(x)[:, :, None],
        torch.from_numpy(y),
        torch.from_numpy(weight),
    )
