"""Checks that the import contracts of pyproject.toml hold, and that each of them catches a planted violation."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.architecture.sources import PACKAGES, ROOT

PLANTED = {
    "Packages: app above rsi_reviews above harness": {"harness/contracts/ids.py": "import rsi_reviews"},
    "Layers of the harness": {"harness/contracts/ids.py": "import harness.gate"},
    "The simulator knows contracts and the provider protocol only": {
        "simulator/planted.py": "import harness.adapters.clock"
    },
    "Nothing below app imports the simulator": {"rsi_reviews/planted.py": "import simulator.robot"},
    "Adapters know only contracts": {"harness/adapters/planted.py": "import harness.projections"},
    "SQL, web and robots stay at the edges": {"harness/routing/planted.py": "import sqlalchemy"},
    "Routes and views use the runtime only": {"app/routes/planted.py": "import harness.supervisor"},
    "rsi_reviews reaches no adapter, gate or supervisor": {"rsi_reviews/planted.py": "import harness.gate"},
    "Release rules know contracts, projections and the runtime": {
        "rsi_reviews/commands.py": "import harness.bootstrap"
    },
    "No generator reads what it is judged by": {"rsi_reviews/generate/planted.py": "import rsi_reviews.held_out"},
    "Views are pure": {"app/views/planted.py": "import fastapi"},
    "No cycles": {"app/one/planted.py": "import app.two.planted", "app/two/planted.py": "import app.one.planted"},
}


def verdicts(folder: Path) -> dict[str, str]:
    """Contract name -> KEPT or BROKEN, for the packages in that folder."""
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"]
    environment = {**os.environ, "PYTHONPATH": str(folder), "NO_COLOR": "1", "COLUMNS": "200"}
    answer = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    found = {
        match.group(1): match.group(2)
        for line in answer.stdout.splitlines()
        if (match := re.match(r"(.+?) (KEPT|BROKEN)\b", line))
    }
    assert found, answer.stdout + answer.stderr
    return found


def test_every_import_contract_is_kept() -> None:
    found = verdicts(ROOT)
    assert set(found) == set(PLANTED)
    assert [name for name, verdict in found.items() if verdict != "KEPT"] == []


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the packages and of their import contracts, in which every test plants its own violation."""
    folder = tmp_path_factory.mktemp("packages")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


@contextmanager
def planted(packages: Path, lines: dict[str, str]) -> Iterator[None]:
    """Add each line to its file, then take away what was added: lines, files and packages."""
    with ExitStack() as after:
        for path, line in lines.items():
            file, package = packages / path, (packages / path).parent
            if not package.exists():
                package.mkdir()
                (package / "__init__.py").touch()
                after.callback(shutil.rmtree, package)
            elif file.exists():
                after.callback(file.write_bytes, file.read_bytes())
            else:
                after.callback(file.unlink)
            with file.open("a", encoding="utf-8") as opened:
                opened.write(f"\n{line}\n")
        yield


@pytest.mark.parametrize("contract", PLANTED)
def test_an_import_contract_catches_a_planted_violation(contract: str, packages: Path) -> None:
    with planted(packages, PLANTED[contract]):
        assert verdicts(packages)[contract] == "BROKEN"
