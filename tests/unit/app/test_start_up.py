"""What a command loads before it does anything: a terminal answers at once."""

import subprocess
import sys

import fastapi.routing
import pytest
from typer.testing import CliRunner

from app import main
from app.cli.main import COMMANDS, GROUPS, app
from tests.builders.consoles import console_stand

HEAVY = ("apprise", "fpdf", "mujoco", "scipy.ndimage", "trimesh", "viser")


def _loaded_by(code: str) -> set[str]:
    listing = f"{code}\nimport sys\nprint('loaded', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=True)
    return set(done.stdout.partition("loaded ")[2].split())


def test_help_loads_neither_the_harness_nor_the_web_framework() -> None:
    loaded = _loaded_by(
        "import sys\nfrom app.cli.main import main\nsys.argv = ['regen', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass"
    )
    assert loaded.isdisjoint({"fastapi", "harness.bootstrap", "numpy", "sqlalchemy", *HEAVY})


def test_a_command_that_shows_no_page_loads_no_viewer_no_mesh_reader_and_no_pdf_writer() -> None:
    loaded = _loaded_by("import app.cli.local_api")
    assert "fastapi" in loaded
    assert loaded.isdisjoint(HEAVY), loaded.intersection(HEAVY)


def test_a_command_that_asks_a_running_console_loads_neither_its_application_nor_the_simulator() -> None:
    loaded = _loaded_by("import app.cli.missions, app.cli.handoffs, app.cli.alerts, app.cli.robots, app.cli.leases")
    assert loaded.isdisjoint({"fastapi", "app.main", "simulator.in_process", *HEAVY})


def test_every_word_of_the_help_says_what_it_is_for() -> None:
    lines = CliRunner().invoke(app, ["--help"]).output.partition("Commands:")[2].splitlines()
    summaries = {line.split()[0]: line.split()[1:] for line in lines if line.startswith("  ") and line[2] != " "}
    assert set(summaries) == {name for name in COMMANDS if " " not in name} | set(GROUPS)
    assert all(summaries.values())


def test_a_stop_does_not_wait_until_the_handlers_of_its_router_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    reads: list[str] = []
    real = fastapi.routing.get_dependant
    monkeypatch.setattr(fastapi.routing, "get_dependant", lambda **given: reads.append(given["path"]) or real(**given))
    main._routes.cache_clear()
    with console_stand() as stand:
        main.read_handlers(stand.app)
        assert "/api/v1/robots/{robot_id}/stop" in reads
        reads.clear()
        assert stand.operator().post("/api/v1/robots/vbot-1/stop", json={}).status_code == 200
    assert reads == []
