"""Files of a model in one of the forms, and writing them: `softnn export`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from softnn.cards.written import WRITERS
from softnn.contracts import InputError
from softnn.export.fmu import fmu
from softnn.export.linear import stored_of
from softnn.export.onnx_file import onnx_model
from softnn.export.parts import Options
from softnn.export.source import c_source
from softnn.export.templates_of import identifier
from softnn.model_file import Stored
from softnn.neural import StoredNetwork

__all__ = ["FORMS", "Options", "c_source", "export", "stored_of", "write"]

Any_model = Stored | StoredNetwork
Files = dict[str, bytes]


def _c(model: Any_model, name: str, options: Options) -> Files:
    header, source = c_source(model, name, options)
    return {f"{name}.h": header.encode(), f"{name}.c": source.encode()}


def _card(ending: str, written: Callable) -> Callable:
    return lambda model, name, _: {f"{name}{ending}": written(model, name).encode()}


FORMS: dict[str, Callable[[Any_model, str, Options], Files]] = {
    "c": _c,
    "onnx": lambda model, name, _: {f"{name}.onnx": onnx_model(model)},
    "fmu": fmu,
    **{code: _card(ending, write) for code, (ending, write) in WRITERS.items()},
}


def export(
    model: Any_model, to: str, name: str, options: Options | None = None
) -> Files:
    """Return the files of a model in the form `to`, by name; nothing is written.

    `name` may be any text; it is turned into a C identifier.
    """
    if to not in FORMS:
        raise InputError(f"no form {to!r}; allowed is {', '.join(FORMS)}")
    if model.axes.component and to != "c":
        raise InputError(
            f"the model is of a component, {model.axes.stress.label} over "
            f"{model.axes.strain.label}; {to} is of strain and MPa. Export it --to c"
        )
    return FORMS[to](model, identifier(name), options or Options())


def write(files: Files, folder: str | Path) -> list[Path]:
    """Write them into a folder and nowhere else; their paths."""
    place = Path(folder)
    paths = [place / file for file in files]
    try:
        place.mkdir(parents=True, exist_ok=True)
        for path, content in zip(paths, files.values(), strict=True):
            if path.is_symlink():  # it may lead out of the folder
                raise InputError(
                    "is a link; remove it or name another --out", file=path
                )
            path.write_bytes(content)
    except OSError as error:
        raise InputError(
            f"cannot be written: {error.strerror or error}", file=place
        ) from None
    return paths
