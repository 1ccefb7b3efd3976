"""Floors: what a package may import directly, beside the import contracts that follow whole chains."""

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from tests.rooms.sources import BUILDINGS, Module, imports, module, modules, under

WORLD = (
    *("asyncio", "glob", "http", "io", "logging", "multiprocessing", "os", "pathlib", "random", "secrets", "shutil"),
    *("signal", "socket", "sqlite3", "ssl", "subprocess", "tempfile", "time", "urllib"),
)
LIBRARIES = (
    *("cv2", "fastapi", "httpx", "jinja2", "mcap", "mujoco", "rosbags", "sqlalchemy", "uvicorn", "viser"),
    "websockets",
)
FUNCTIONS_ONLY = (
    *("contracts", "projections", "planning", "contexts", "routing", "verification", "recovery", "memory"),
    "exploration",
)

SHARED_BETWEEN_THREADS = ("harness.memory.fabric", "harness.memory.recent")
"""What follows the log for several readers at once holds a lock; everything else on these floors is a function."""
LOCKED_IN_THE_GATE = ("harness.gate.commit", "harness.gate.aggregate_cache", "harness.gate.ended_missions")


@dataclass(frozen=True)
class Wall:
    """Modules under `room` may not import anything under `never`, save what lies under `save`."""

    room: str
    never: tuple[str, ...]
    save: tuple[str, ...] = ()
    exempt: tuple[str, ...] = ()


WALLS = (
    *(Wall(f"harness.{room}", (*WORLD, *LIBRARIES)) for room in FUNCTIONS_ONLY),
    *(Wall(f"harness.{room}", ("threading",), exempt=SHARED_BETWEEN_THREADS) for room in FUNCTIONS_ONLY),
    Wall("harness.gate", (*WORLD, *LIBRARIES)),
    Wall("harness.gate", ("threading",), exempt=LOCKED_IN_THE_GATE),
    Wall("harness.contracts", ("harness",), save=("harness.contracts",)),
    Wall("harness.projections", ("harness",), save=("harness.contracts", "harness.projections")),
    Wall(
        "harness.adapters",
        ("harness", "app", "rsi_reviews"),
        save=("harness.adapters", "harness.contracts", "harness.provider_protocol"),
    ),
    Wall("harness.provider_protocol", ("harness",), save=("harness.contracts", "harness.provider_protocol")),
    Wall("harness", ("simulator",)),
    Wall("rsi_reviews", ("simulator",)),
    Wall("simulator", ("app", "rsi_reviews", "harness"), save=("harness.contracts", "harness.provider_protocol")),
    Wall("harness.runtime", ("harness.adapters", "harness.supervisor", "harness.bootstrap", "harness.settings")),
    Wall("harness.supervisor", (*LIBRARIES, "harness.adapters", "harness.bootstrap", "harness.settings")),
    Wall("harness.supervisor", ("random", "secrets", "socket", "sqlite3", "subprocess", "urllib")),
    Wall("rsi_reviews", ("app", "harness.gate", "harness.supervisor", "harness.adapters", *LIBRARIES)),
    Wall(
        "rsi_reviews",
        ("harness.bootstrap",),
        exempt=("rsi_reviews.regression", "rsi_reviews.evaluation", "rsi_reviews.recursion"),
    ),
    Wall("app.views", ("harness.runtime", "harness.bootstrap", "app.routes", *WORLD, *LIBRARIES)),
    Wall("app.views", ("harness",), save=("harness.contracts", "harness.projections")),
    Wall("app.scene", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap")),
    Wall("app.live", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap", "viser")),
    Wall("app.security", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap", "viser")),
    Wall("app.routes", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap", "sqlalchemy")),
)


def breaches(source: Module, walls: tuple[Wall, ...] = WALLS) -> Iterator[str]:
    """Every direct import that goes through a wall."""
    for wall in walls:
        if not under(source.name, wall.room) or any(under(source.name, room) for room in wall.exempt):
            continue
        for line, name in imports(source.tree):
            if any(under(name, banned) for banned in wall.never) and not any(under(name, kept) for kept in wall.save):
                yield f"{source.path}:{line}: {wall.room} may not import {name}"


def test_no_import_goes_through_a_wall() -> None:
    assert [breach for source in modules(*BUILDINGS) for breach in breaches(source)] == []


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("harness/gate/rules.py", "import time"),
        ("harness/bootstrap.py", "from simulator.in_process import SIMULATOR"),
        ("rsi_reviews/regression/conduct.py", "from simulator.in_process import SIMULATOR"),
        ("simulator/robot.py", "from harness.adapters.clock import LockstepClock"),
        ("harness/provider_protocol/service.py", "import harness.adapters.clock"),
        ("harness/verification/geometry.py", "from pathlib import Path"),
        ("harness/contracts/ids.py", "from harness.gate.rules import x"),
        ("harness/adapters/clock.py", "from harness.runtime import Runtime"),
        ("harness/adapters/clock.py", "import harness.projections.mission"),
        ("harness/supervisor/dispatch.py", "import harness.adapters.clock"),
        ("rsi_reviews/desk.py", "from harness.bootstrap import simulated"),
        ("app/views/missions.py", "from harness import runtime"),
        ("app/views/missions.py", "import jinja2"),
        ("app/routes/missions.py", "from harness.bootstrap import harness"),
    ],
)
def test_a_hole_in_a_wall_is_found(path: str, text: str) -> None:
    assert list(breaches(module(path, text)))


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("harness/adapters/clock.py", "from harness.contracts.ports import Clock\nimport time"),
        ("rsi_reviews/regression.py", "from harness.bootstrap import simulated"),
        ("simulator/robot.py", "from harness.provider_protocol.journal import Journal"),
        ("app/views/missions.py", "from harness.projections.mission import Mission"),
    ],
)
def test_a_door_is_no_hole(path: str, text: str) -> None:
    assert list(breaches(module(path, text))) == []
