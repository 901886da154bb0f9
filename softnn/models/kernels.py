"""The compiled recursions of Maxwell branches, at constant and at irregular steps.

Imported when first needed, because numba loads slowly; numba caches the machine code
on disk.

Arrays: step_s (m,), increment (m, 1 or sets), out (m, sets), all others (sets,
branches); `carried` is left at the end of the chunk.
"""

from __future__ import annotations

import numba
import numpy as np

FLUSH = 4096  # samples after which negligible stress is set to zero
TINY = 1e-290  # subnormal numbers, below 2e-308, are a hundred times slower


@numba.njit(cache=True)
def constant(decay, gain, increment, carried, out):
    """Sum of branch stresses after each increment; decay and gain hold for all."""
    samples, sets = out.shape
    branches = decay.shape[1]
    for s in range(sets):
        a, b, q = decay[s], gain[s], carried[s]
        column = increment[:, s if increment.shape[1] > 1 else 0]
        for start in range(0, samples, FLUSH):
            for t in range(start, min(start + FLUSH, samples)):
                jump = column[t]
                total = 0.0
                for j in range(branches):
                    q[j] = a[j] * q[j] + b[j] * jump
                    total += q[j]
                out[t, s] = total
            for j in range(branches):
                if abs(q[j]) < TINY:
                    q[j] = 0.0


@numba.njit(cache=True)
def irregular(step_s, increment, stiffness, time, exact, carried, out):
    """Sum of branch stresses after each increment; each step has its own length."""
    samples, sets = out.shape
    branches = time.shape[1]
    rate = 1.0 / time
    for s in range(sets):
        q, k, r = carried[s], stiffness[s], rate[s]
        column = increment[:, s if increment.shape[1] > 1 else 0]
        for t in range(samples):
            jump, step = column[t], step_s[t]
            total = 0.0
            for j in range(branches):
                x = step * r[j]
                if not exact:
                    decay = gain = 1.0 / (1.0 + x)
                elif x > 1e-8:
                    lost = np.expm1(-x)  # 1 - exp(-x) would cancel at short steps
                    decay = 1.0 + lost
                    gain = -lost / x
                else:
                    decay, gain = 1.0 - x, 1.0
                q[j] = decay * q[j] + gain * k[j] * jump
                if abs(q[j]) < TINY:
                    q[j] = 0.0
                total += q[j]
            out[t, s] = total
