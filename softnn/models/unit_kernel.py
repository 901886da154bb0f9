"""The compiled recursion behind `softnn.models.units`, imported where first needed."""

from __future__ import annotations

import numba


@numba.njit(cache=True)
def maxwell(decay, gain, increment, carried, out):
    """Unit stress of each branch: decay, gain and out are (n, branches)."""
    n, count = out.shape
    for j in range(count):
        out[0, j] = decay[0, j] * carried[j] + gain[0, j] * increment[0]
    for i in range(1, n):
        jump = increment[i]
        for j in range(count):
            out[i, j] = decay[i, j] * out[i - 1, j] + gain[i, j] * jump


@numba.njit(cache=True)
def borne(decay, gain, increment, stiffness, carried, out):
    """Stress of all branches together, added to out (n, sets), as increment is.

    carried (sets, branches): unit stress of each branch before, and after it is done.
    """
    n, sets = out.shape
    for s in range(sets):
        for j in range(len(stiffness)):
            q = carried[s, j]
            for i in range(n):
                q = decay[i, j] * q + gain[i, j] * increment[i, s]
                out[i, s] += stiffness[j] * q
            carried[s, j] = q
