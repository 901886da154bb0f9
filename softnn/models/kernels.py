"""The compiled recursion of Maxwell branches at irregular steps.

Imported where it is first needed, so that numba's start is paid only then; the
machine code is kept on disk by numba.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def irregular(step_s, increment, stiffness, time, exact, carried, out):
    """Sum of branch stresses after each increment; `carried` is left at the end.

    step_s (m,), increment (m, 1 or sets), stiffness, time and carried (sets,
    branches), out (m, sets).
    """
    sets, branches = stiffness.shape
    shared = increment.shape[1] == 1
    for t in range(step_s.shape[0]):
        for s in range(sets):
            jump = increment[t, 0 if shared else s]
            total = 0.0
            for j in range(branches):
                x = step_s[t] / time[s, j]
                if not exact:
                    decay = 1.0 / (1.0 + x)
                    gain = decay
                elif x > 1e-8:
                    lost = np.expm1(-x)
                    decay = 1.0 + lost
                    gain = -lost / x
                else:  # two terms of the series are exact to rounding here
                    decay = 1.0 - x
                    gain = 1.0 - 0.5 * x
                q = decay * carried[s, j] + gain * stiffness[s, j] * jump
                if abs(q) < 1e-290:  # subnormal numbers are a hundred times slower
                    q = 0.0
                carried[s, j] = q
                total += q
            out[t, s] = total
