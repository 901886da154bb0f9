"""Files made to harm: bombs, devices, broken bytes; each one line, at once."""

from __future__ import annotations

import gzip
import io
import time
import zipfile
from pathlib import Path

import pytest
from readers_made import (
    BOTH,
    zwick_workbook,
)

from softnn.contracts import InputError
from softnn.readers import read

# -- hostile files


def refused_quickly(path: Path, said: str) -> None:
    start = time.perf_counter()
    with pytest.raises(InputError, match=said):
        read(path, **BOTH)
    assert time.perf_counter() - start < 5


def test_gzip_bomb(tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(gzip.compress(bytes(150_000_000), 9)))
    refused_quickly(path, "NUL|not text|no table")
    path.write_bytes(gzip.compress(b"1,2\n" * 30_000_000, 1))
    refused_quickly(path, "unpacks to over")


def test_zip_bomb(tmp_path: Path) -> None:
    path = zwick_workbook(tmp_path / "a.xlsx")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/padding.xml", bytes(50_000_000))
    refused_quickly(path, "unpacks to over")


def with_member(path: Path, name: str, text: str) -> Path:
    """The workbook with one member's content replaced."""
    copy = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w") as new:
        for item in old.infolist():
            data = text.encode() if item.filename == name else old.read(item)
            new.writestr(item.filename, data)
    path.write_bytes(copy.getvalue())
    return path


SHEET = "xl/worksheets/sheet1.xml"


def test_xml_bomb(tmp_path: Path) -> None:
    laughs = "".join(
        f'<!ENTITY l{i} "{f"&l{i - 1};" * 10 if i else "lol"}">' for i in range(12)
    )
    bomb = f"<?xml version='1.0'?><!DOCTYPE w [{laughs}]><w>&l11;</w>"
    path = zwick_workbook(tmp_path / "a.xlsx")
    refused_quickly(with_member(path, SHEET, bomb), "damaged")


@pytest.mark.slow
def test_cell_far_beyond_the_sheet(tmp_path: Path) -> None:
    path = zwick_workbook(tmp_path / "a.xlsx")
    far = (
        '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">'
        '<dimension ref="A1:XFD1048576"/><sheetData><row r="999999999999">'
        '<c r="A999999999999"><v>1</v></c></row></sheetData></worksheet>'
    )
    refused_quickly(with_member(path, SHEET, far), "cells|damaged")


def test_folder_and_device(tmp_path: Path) -> None:
    refused_quickly(tmp_path, "^[^:]*: is a folder")
    refused_quickly(Path("/dev/zero"), "^/dev/zero: is not a plain file")


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"", "empty"),
        (b"\x00" * 1000, "empty"),
        (bytes(range(256)) * 40, "not text"),
        (b"%PDF-1.7\n1,2\n3,4\n", "PDF"),
        (b"<html><table><tr><td>1</td></tr></table></html>", "web page"),
        (b"PK\x03\x04 nothing", "damaged"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "damaged"),
        (b"\x1f\x8b\x08 nothing", "gzip"),
        (b"just a few words\nand no numbers\n", "no table"),
        (b"1,2,3\n" * 50, "without column names"),
        (b"Time (s),Force (N)\n" + b"1,2" * 100_000, "no table"),
        (b"Time (s),Force (N)\n" + b'"' + b"1,2\n" * 100, "quotation"),
        (b"a," * 5000 + b"\n" + b"1," * 5000, "columns|no table"),
    ],
)
def test_hostile_bytes(raw: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_bytes(raw)
    refused_quickly(path, said)
