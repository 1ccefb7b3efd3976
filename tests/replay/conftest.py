"""Real recordings from outside the project, or a skip that says where they were looked for."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real recordings: REGEN_DATA, default ../shared/data beside the project."""
    folder = Path(os.environ.get("REGEN_DATA", ROOT.parent / "shared" / "data"))
    if not (folder / "INDEX.md").exists():
        pytest.skip(f"no real recordings in {folder}: set REGEN_DATA to their folder")
    return folder
