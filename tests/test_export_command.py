"""`softnn export`: what it writes, and names and files from outside."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from export_made import STRICT, Compiled, base

from softnn import cli
from softnn.contracts import InputError
from softnn.export.files import export
from softnn.export.templates_of import identifier
from softnn.model_file import Stored, read_model

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def stored_file(path, name="pl-wiechert", **more):
    units, stiffness = base()
    content = {
        "kind": "softnn-model",
        "version": 1,
        "history": "fresh",
        "base": {
            "name": name,
            "knots": list(units.knots),
            "relaxation_times_s": list(units.relaxation_times),
            "stiffness_MPa": stiffness.tolist(),
        },
        "effects": [],
    } | more
    path.write_text(json.dumps(content))
    return path


def test_command_writes_c_that_compiles(tmp_path, capsys):
    model = stored_file(tmp_path / "My model (2).json")
    out = tmp_path / "out"
    assert cli.main(["export", str(model), "--to", "c", "--out", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["my_model_2.c", "my_model_2.h"]
    command = ["gcc", *STRICT, "-c", "my_model_2.c", "-o", "x.o"]
    subprocess.run(command, cwd=out, check=True)
    assert str(out / "my_model_2.c") in capsys.readouterr().out


EVIL = '*/ int main(void){return 1;} /* "\n#include </etc/passwd>\n?>\x00é'


def test_a_hostile_name_gets_into_nothing(tmp_path):
    with pytest.raises(InputError, match="no base"):  # files are refused before
        read_model(stored_file(tmp_path / "m.json", name=EVIL))
    units, stiffness = base()
    evil = replace(units, name=EVIL)
    model = Stored(evil, stiffness, (), (), False, "fresh")
    for form, marks in (("c", ("/*", " *")), ("abaqus", "**"), ("ansys", "!")):
        for file, content in export(model, form, "../../" + EVIL).items():
            assert Path(file).name == file
            text = content.decode("ascii")
            lines = [x for x in text.splitlines() if "main(" in x or "passwd" in x]
            lines = [x for x in lines if not x.startswith(marks)]
            assert not [x for x in lines if "main(" in x or "#include <" in x]
            assert text.count("/*") == text.count("*/")
    library = tmp_path / "m.so"
    library.write_bytes(export(model, "fmu", EVIL).popitem()[1])
    assert Compiled(tmp_path, model, identifier(EVIL)).flags


def test_numbers_that_are_none_are_refused(tmp_path):
    path = stored_file(tmp_path / "m.json")
    content = json.loads(path.read_text())
    content["base"]["stiffness_MPa"][0] = float("inf")
    path.write_text(json.dumps(content))
    assert cli.main(["export", str(path), "--to", "c", "--out", str(tmp_path)]) == 2


def test_a_link_in_the_folder_is_not_followed(tmp_path):
    out, other = tmp_path / "out", tmp_path / "other.c"
    out.mkdir()
    (out / "m.c").symlink_to(other)
    model = stored_file(tmp_path / "m.json")
    assert cli.main(["export", str(model), "--to", "c", "--out", str(out)]) == 2
    assert not other.exists()
