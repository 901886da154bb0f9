"""What tests of the readers share."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softnn.recording import Recording

REFERENCE = Path(__file__).parent / "reference"

I = np.arange(12.0)  # noqa: E741

TIME, STRAIN, STRESS = 0.5 * I, 0.01 * I, (I + I**2 / 4) / 10

LENGTH, AREA = {"length_mm": 20.0}, {"area_mm2": 10.0}

BOTH = {**LENGTH, **AREA}


def assert_same(found: Recording, sign: int = 1, rows: slice = slice(None)) -> None:
    """The invented test to the six decimals its files are written with."""
    for name, values in (
        ("time_s", TIME),
        ("strain", sign * STRAIN),
        ("stress_MPa", sign * STRESS),
    ):
        np.testing.assert_allclose(
            getattr(found, name), values[rows], rtol=1e-5, atol=2e-6, err_msg=name
        )


def zwick_workbook(path: Path) -> Path:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Results"
    for row in (
        [None, "Specimen designation", "a0", "b0", "S0", "Test speed"],
        [None, None, "mm", "mm", "mm\u00b2", "mm/min"],
        [None, "one", 2, 5, 10, 24],
        [None, "two", 4, 5, 20, 24],
    ):
        sheet.append(row)
    for name, factor in (("one", 1), ("two", 2)):
        sheet = book.create_sheet(f"Values {name}")
        sheet.append([name] * 3)
        sheet.append(["Time", "Standard force", "Standard travel"])
        sheet.append(["s", "N", "mm"])
        for t, e, s in zip(TIME, STRAIN, STRESS, strict=True):
            sheet.append([float(t), float(s * 10 * factor), float(e * 20)])
    book.save(path)
    return path
