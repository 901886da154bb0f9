"""What the likelihood-ratio test sees that knows the law, the programme and the noise.

Twice the log likelihood ratio of an effect is chi-squared, with the energy that the
base leaves of it as its non-centrality (Wilks 1938, doi:10.1214/aoms/1177732360;
Kendall and Stuart, vol. 2). No test with as many false alarms sees more.
"""

from __future__ import annotations

from scipy.stats import chi2, ncx2

from bench.hands.testing import Act

FALSE_ALARM = 0.01


def power(energy: float, parameters: int) -> float:
    """Chance that the test sees an effect, at one false alarm in a hundred.

    `energy`: sum of squares that the base at its best leaves of it, in units of the
    noise (`bench.hands.bases`).
    """
    limit = chi2.ppf(1 - FALSE_ALARM, parameters)
    return float(ncx2.sf(limit, parameters, max(energy, 1e-12)))


def degrees(act: Act) -> int:
    """Free parameters of a law for the test: one, or one a recording."""
    lists = [v for v in act.parameters.values() if isinstance(v, dict | list)]
    return max([1, *(len(v) for v in lists)])
