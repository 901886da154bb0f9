"""`softnn export`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softnn.contracts import InputError

if TYPE_CHECKING:
    from softnn.recording import Recording

FORMS = (
    "c",
    "onnx",
    "fmu",
    "abaqus",
    "ansys",
    "febio",
)  # of `softnn.export.files`, not imported yet


CARDS = ("abaqus", "ansys", "febio")
ENDINGS = (".c", ".h", ".fmu", ".onnx", ".inp", ".mac", ".txt", ".feb")  # of no folder


def add_export(commands: Any) -> None:
    parser = commands.add_parser(
        "export",
        help="a model.json or network.json -> C, ONNX, FMU, Abaqus, Ansys, FEBio",
        description="Write a model for a controller or a finite-element code. Forms: "
        "C99 with one step function; an FMU for FMI 2.0 and 3.0; ONNX for networks; "
        "material cards, which say what they cannot carry. A card whose stress is more "
        "than 10 % off the model's is refused.",
        epilog="Example: softnn export found/case/model.json --to c --out controller",
    )
    parser.add_argument(
        "model",
        metavar="MODEL.json",
        help="a model.json, a network.json, or models:/NAME@ALIAS of MLflow",
    )
    parser.add_argument("--to", required=True, choices=FORMS)
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument("--name", help="of functions and files (the model's file)")
    parser.add_argument(
        "--recording", metavar="NAME", help="take the values that are this recording's"
    )
    parser.add_argument(
        "--leave-out",
        action="append",
        default=[],
        metavar="WHAT",
        help="export without what cannot be stepped (inertia, learned)",
    )
    parser.add_argument(
        "--recordings",
        nargs="+",
        default=[],
        metavar="FILE",
        help="over whose strain a material card is compared with the model (else over "
        "cycles and a hold in the model's own range)",
    )
    parser.add_argument(
        "--anyway",
        action="store_true",
        help="write a material card however far it is from the model",
    )
    parser.add_argument(
        "--interval",
        type=float,
        default=1e-3,
        metavar="S",
        help="shortest time between samples, for delays (0.001)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from softnn.export.files import Options, export, write
    from softnn.mismatch.api import load_model

    out = Path(arguments.out)
    if out.suffix in ENDINGS and not out.is_dir():
        raise InputError(
            f"--out is {arguments.out!r}, and names a folder; say --out "
            f"{out.parent} --name {out.stem}"
        )
    model = load_model(arguments.model)
    name = arguments.name or Path(arguments.model).stem
    options = Options(
        arguments.recording, tuple(arguments.leave_out), arguments.interval
    )
    files = export(model, arguments.to, name, options)
    lines = []
    if arguments.to in CARDS:
        lines = compared(model, _read(arguments.recordings), arguments.anyway)
    for path in write(files, arguments.out):
        print(path)
    for line in lines:
        print(f"softnn: {line}", file=sys.stderr)
    return 0


def compared(model: Any, recordings: Sequence[Recording], anyway: bool) -> list[str]:
    """Lines on what a card of the model lacks. Raises `InputError` for too much."""
    from softnn.cards.loss import MOST, loss
    from softnn.cards.written import card

    made = card(model)
    found = loss(model, made, recordings)
    if found.whole > MOST and not anyway:
        raise InputError(f"{found.line}; --anyway writes it all the same")
    lines = [found.line, *(f"not carried: {m}" for m in made.missing)]
    if made.of_test:
        names = ", ".join(made.of_test)
        lines.append(f"of the test, not of the material, so not in the card: {names}")
    return lines


def _read(files: Sequence[str]) -> list[Recording]:
    from softnn.mismatch.api import read

    return read(files) if files else []
