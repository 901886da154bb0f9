"""Mismatch: locate it, explain it, model it, verify it.

`diagnose(read_case(folder))` is all of it. Steps: the base is fitted (`base`), sets
of effects are sought (`accounts`) and weighed (`evidence`, `posterior`), what none of
them explains is learned (`learn`), regions are told (`locate`), and all of it is held
against recordings left out (`verify`).
"""

from softnn.mismatch.case import Case, read_case
from softnn.mismatch.diagnosis import Diagnosis, diagnose

__all__ = ["Case", "Diagnosis", "diagnose", "read_case"]
