"""Mismatch: locate it, explain it, model it, verify it.

`diagnosis.diagnose(case.read_case(folder))` is all of it. Steps: the base is fitted
(`base`), sets of effects are sought (`accounts`) and weighed (`evidence`, `posterior`),
the verdict is given on recordings left out (`verdict`, `verify`), what no effect
explains is learned (`learn`), regions are found (`locate`), and all of it is written
down (`written`, `words`).
"""
