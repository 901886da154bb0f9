"""Mismatch: locate it, explain it, model it, verify it.

`diagnose(read_case(folder))` is all of it (`diagnosis`). Steps: the base is fitted
(`base`), sets of effects are sought (`accounts`) and weighed (`evidence`, `posterior`),
the verdict is given on recordings left out (`verdict`, `verify`), what no effect
explains is learned (`learn`), regions are found (`locate`), and all of it is written
down (`written`, `words`).
"""

from softnn.mismatch.case import Case, read_case
from softnn.mismatch.diagnosis import Diagnosis, diagnose

__all__ = ["Case", "Diagnosis", "diagnose", "read_case"]
