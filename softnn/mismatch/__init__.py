"""Mismatch: locate it, explain it, model it, verify it.

`diagnose(read_case(folder))` is all of it (`diagnosis`). Steps: the base is fitted
(`base`), sets of effects are sought (`accounts`) and weighed (`evidence`, `posterior`),
the verdict is given on recordings left out (`verdict`, `verify`), what no effect
explains is learned (`learn`), regions are found (`locate`), and all of it is written
down (`written`, `words`).
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softnn.mismatch.case import Case, read_case
    from softnn.mismatch.diagnosis import Diagnosis, diagnose

__all__ = ["Case", "Diagnosis", "diagnose", "read_case"]


def __getattr__(name: str) -> Any:
    # Solvers and compilers are loaded when first asked for, not to parse a command.
    if name in __all__:
        from softnn.mismatch import case, diagnosis

        return getattr(case if name in ("Case", "read_case") else diagnosis, name)
    raise AttributeError(f"module 'softnn.mismatch' has no attribute {name!r}")
