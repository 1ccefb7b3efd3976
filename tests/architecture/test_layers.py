"""Checks what each package may import directly, beside the import contracts that follow whole chains."""

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from tests.architecture.sources import PACKAGES, Module, imports, module, modules, under

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

SHARED_BETWEEN_THREADS = ("harness.memory.fabric", "harness.memory.history")
"""What follows the log for several readers at once holds a lock; everything else in these layers is a function."""
LOCKED_IN_THE_GATE = (
    "harness.gate.commit",
    "harness.gate.aggregate_cache",
    "harness.gate.ended_missions",
    "harness.gate.site_versions",
)


@dataclass(frozen=True)
class ImportRule:
    """Modules under `package` may not import anything under `never`, except what is under `save`."""

    package: str
    never: tuple[str, ...]
    save: tuple[str, ...] = ()
    exempt: tuple[str, ...] = ()


IMPORT_RULES = (
    *(ImportRule(f"harness.{package}", (*WORLD, *LIBRARIES)) for package in FUNCTIONS_ONLY),
    *(ImportRule(f"harness.{package}", ("threading",), exempt=SHARED_BETWEEN_THREADS) for package in FUNCTIONS_ONLY),
    ImportRule("harness.gate", (*WORLD, *LIBRARIES)),
    ImportRule("harness.gate", ("threading",), exempt=LOCKED_IN_THE_GATE),
    ImportRule("harness.contracts", ("harness",), save=("harness.contracts",)),
    ImportRule("harness.projections", ("harness",), save=("harness.contracts", "harness.projections")),
    ImportRule(
        "harness.adapters",
        ("harness", "app", "rsi_reviews"),
        save=("harness.adapters", "harness.contracts", "harness.provider_protocol"),
    ),
    ImportRule("harness.provider_protocol", ("harness",), save=("harness.contracts", "harness.provider_protocol")),
    ImportRule("harness", ("simulator",)),
    ImportRule("rsi_reviews", ("simulator",)),
    ImportRule("simulator", ("app", "rsi_reviews", "harness"), save=("harness.contracts", "harness.provider_protocol")),
    ImportRule("harness.runtime", ("harness.adapters", "harness.supervisor", "harness.bootstrap", "harness.settings")),
    ImportRule("harness.supervisor", (*LIBRARIES, "harness.adapters", "harness.bootstrap", "harness.settings")),
    ImportRule("harness.supervisor", ("random", "secrets", "socket", "sqlite3", "subprocess", "urllib")),
    ImportRule("rsi_reviews", ("app", "harness.gate", "harness.supervisor", "harness.adapters", *LIBRARIES)),
    ImportRule(
        "rsi_reviews",
        ("harness.bootstrap",),
        exempt=("rsi_reviews.regression", "rsi_reviews.evaluation", "rsi_reviews.recursion"),
    ),
    ImportRule("app.views", ("harness.runtime", "harness.bootstrap", "app.routes", *WORLD, *LIBRARIES)),
    ImportRule("app.views", ("harness",), save=("harness.contracts", "harness.projections")),
    ImportRule("app.scene.servers", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap")),
    ImportRule(
        "app.background.signals",
        ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap", "viser"),
    ),
    ImportRule(
        "app.web.security", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap", "viser")
    ),
    ImportRule(
        "app.routes", ("harness.adapters", "harness.gate", "harness.supervisor", "harness.bootstrap", "sqlalchemy")
    ),
)


def breaches(source: Module, rules: tuple[ImportRule, ...] = IMPORT_RULES) -> Iterator[str]:
    """Every direct import that violates a rule."""
    for rule in rules:
        if not under(source.name, rule.package) or any(under(source.name, package) for package in rule.exempt):
            continue
        for line, name in imports(source.tree):
            if any(under(name, banned) for banned in rule.never) and not any(under(name, kept) for kept in rule.save):
                yield f"{source.path}:{line}: {rule.package} may not import {name}"


def test_no_import_breaks_a_rule() -> None:
    assert [breach for source in modules(*PACKAGES) for breach in breaches(source)] == []


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("harness/gate/rules.py", "import time"),
        ("harness/bootstrap.py", "from simulator.in_process import SIMULATOR"),
        ("rsi_reviews/regression/case_run.py", "from simulator.in_process import SIMULATOR"),
        ("simulator/robot.py", "from harness.adapters.clock import LockstepClock"),
        ("harness/provider_protocol/service.py", "import harness.adapters.clock"),
        ("harness/verification/geometry.py", "from pathlib import Path"),
        ("harness/contracts/ids.py", "from harness.gate.rules import x"),
        ("harness/adapters/clock.py", "from harness.runtime import Runtime"),
        ("harness/adapters/clock.py", "import harness.projections.mission"),
        ("harness/supervisor/dispatch.py", "import harness.adapters.clock"),
        ("rsi_reviews/release_service.py", "from harness.bootstrap import simulated"),
        ("app/views/missions.py", "from harness import runtime"),
        ("app/views/missions.py", "import jinja2"),
        ("app/routes/missions.py", "from harness.bootstrap import harness"),
    ],
)
def test_a_breach_is_found(path: str, text: str) -> None:
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
def test_an_exception_is_no_breach(path: str, text: str) -> None:
    assert list(breaches(module(path, text))) == []
