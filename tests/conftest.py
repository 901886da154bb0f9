import os
from pathlib import Path

import pytest


@pytest.fixture
def data_folder() -> Path:
    """The folder of real recordings; without it the test is skipped, saying so."""
    folder = os.environ.get("SOFTNN_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("no real recordings: SOFTNN_DATA names no folder")
    return Path(folder)
