"""`softnn export`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

FORMS = (
    "c",
    "onnx",
    "fmu",
    "abaqus",
    "ansys",
)  # of `softnn.export.files`, not imported yet


def add_export(commands: Any) -> None:
    parser = commands.add_parser(
        "export",
        help="a model.json or network.json -> C, ONNX, FMU, Abaqus, Ansys",
        description="Write a model for a controller or a finite-element code: C99 with "
        "one step function, an FMU for FMI 2.0 and 3.0, ONNX for networks, material "
        "cards that say what they cannot carry.",
        epilog="Example: softnn export found/case/model.json --to c --out controller",
    )
    parser.add_argument("model", metavar="MODEL.json")
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
        "--interval",
        type=float,
        default=1e-3,
        metavar="S",
        help="shortest time between samples, for delays (0.001)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from softnn.export.files import Options, export, write
    from softnn.model_file import read_model

    model = read_model(arguments.model)
    name = arguments.name or Path(arguments.model).stem
    options = Options(
        arguments.recording, tuple(arguments.leave_out), arguments.interval
    )
    for path in write(export(model, arguments.to, name, options), arguments.out):
        print(path)
    return 0
