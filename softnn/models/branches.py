r"""Maxwell branches in parallel, driven by strain: the recursion behind every model.

The stress :math:`\sigma_j` of a branch obeys
:math:`\dot\sigma_j + \sigma_j/\tau_j = k_j \dot\varepsilon`. Two updates over a step
:math:`\Delta t`, with :math:`x = \Delta t/\tau_j`, both of the form
:math:`\sigma_j \leftarrow a\,\sigma_j + b\,k_j\,\Delta\varepsilon`:

- ``exact``: :math:`a = e^{-x}`, :math:`b = (1 - e^{-x})/x`. It is exact for strain
  that is linear between samples (Taylor, Pister and Goudreau 1970,
  doi:10.1002/nme.1620020106).
- ``euler``: :math:`a = b = 1/(1 + x)`. Implicit Euler, the finite-difference form of
  the thesis (eq. 5.6), is first order in :math:`\Delta t`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from softnn.contracts import Array, Chunk, InputError

Update = Literal["exact", "euler"]
UPDATES = ("exact", "euler")
FEW = 4  # steps up to which a chunk is left to NumPy: a controller needs no numba


class BranchState(NamedTuple):
    """State at the end of a chunk: last time [s], last strain, branch stresses."""

    time_s: float
    strain: Array  # (1,) or (sets,)
    stress: Array  # (sets, branches)


def check_update(update: str) -> None:
    """Raise `InputError` unless `update` names one of the two update formulas."""
    if update not in UPDATES:
        raise InputError(f"update is {update!r}; allowed is one of {list(UPDATES)}")


def history(
    time_s: Array, strain: Array, before: float | None
) -> tuple[Array, Array, Array]:
    """Return time (n,), strain (n, 1 or sets) and steps (n,) of a chunk, checked.

    The first step is the time since `before` [s], or 0 without an earlier chunk. Raises
    `InputError` where shapes do not fit or time decreases.
    """
    time = np.asarray(time_s, dtype=float)
    columns = np.asarray(strain, dtype=float)
    if columns.ndim == 1:
        columns = columns[:, None]
    if time.ndim != 1 or columns.ndim != 2 or len(time) != len(columns):
        raise InputError(
            f"time_s has shape {time.shape}, strain {np.shape(strain)}; "
            "allowed is (n,) with (n,) or (n, sets)"
        )
    if not len(time):
        raise InputError("a chunk of no samples; at least one is needed")
    if not np.isfinite(columns).all():
        sample = int(np.argmin(np.isfinite(columns).all(axis=1)))
        raise InputError(
            f"strain of sample {sample} is no number; a model needs every strain: "
            "fill the gap or cut the recording there"
        )
    steps = np.empty(len(time))
    steps[0] = 0.0 if before is None else time[0] - before
    np.subtract(time[1:], time[:-1], out=steps[1:])
    if not (steps >= 0).all():  # NaN is bad too
        sample = int(np.argmin(steps >= 0))
        raise InputError(f"time goes backwards at sample {sample} of the chunk")
    return time, columns, steps


def coefficients(step_s: Array | float, time: Array, update: Update) -> tuple:
    """Return decay `a` and gain `b` of each branch over a step; see the module.

    `step_s` and the relaxation times `time` are in s and broadcast.
    """
    x = np.asarray(step_s / time)
    if update == "euler":
        decay = 1 / (1 + x)
        return decay, decay
    with np.errstate(invalid="ignore"):
        gain = np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1.0)
    return np.exp(-x), gain


def respond(
    stiffness: Array,
    relaxation_time: Array,
    chunk: Chunk,
    state: BranchState | None,
    update: Update = "exact",
) -> tuple[Array, BranchState]:
    """Summed branch stress (n, sets) over a chunk, MPa, and the state at its end.

    stiffness [MPa] and relaxation_time [s] are (sets, branches); the branches see
    `chunk.branch_strain`, or `chunk.strain` where that is None.
    """
    given = chunk.strain if chunk.branch_strain is None else chunk.branch_strain
    time, strain, steps = history(
        chunk.time_s, given, None if state is None else state.time_s
    )
    before = np.zeros(1) if state is None else state.strain
    sets = max(strain.shape[1], stiffness.shape[0])
    shape = (sets, stiffness.shape[1])
    k = np.ascontiguousarray(np.broadcast_to(stiffness, shape))
    tau = np.ascontiguousarray(np.broadcast_to(relaxation_time, shape))
    carried = (
        np.zeros(shape)
        if state is None
        else np.array(np.broadcast_to(state.stress, shape))
    )
    out = np.zeros((len(time), sets))
    if shape[1]:
        increments = np.diff(strain, axis=0)
        a, b = coefficients(steps[0], tau, update)
        carried = a * carried + b * k * (strain[0] - before)[:, None]
        out[0] = carried.sum(axis=1)
        rest = steps[1:]
        if len(rest) <= FEW:
            for i, step in enumerate(rest):
                a, b = coefficients(step, tau, update)
                carried = a * carried + b * k * increments[i][:, None]
                out[i + 1] = carried.sum(axis=1)
        elif evenly(time):
            from softnn.models.kernels import constant

            a, b = coefficients((time[-1] - time[0]) / len(rest), tau, update)
            constant(a, b * k, increments, carried, out[1:])
        else:
            from softnn.models.kernels import irregular

            irregular(rest, increments, k, tau, update == "exact", carried, out[1:])
    return out, BranchState(float(time[-1]), strain[-1].copy(), carried)


def evenly(time_s: Array) -> bool:
    """Whether time steps are constant, to the rounding of the times themselves."""
    n = len(time_s)
    even = np.linspace(time_s[0], time_s[-1], n)
    if not even[-1] > even[0]:
        return False
    even -= time_s
    scale = max(abs(time_s[0]), abs(time_s[-1]))
    return bool(np.abs(even, out=even).max() <= 4 * np.finfo(float).eps * scale)
