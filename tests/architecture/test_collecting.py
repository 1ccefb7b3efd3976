"""Checks how tests are collected: missions on real physics are counted, tests run in order, campaigns are marked."""

import os
import subprocess
import sys
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from xdist.workermanage import WorkerController

from tests.conftest import (
    MUJOCO_MISSIONS,
    ROOT,
    SharedOnOneWorker,
    mujoco_missions,
    pytest_collection_modifyitems,
)


@dataclass
class Collected:
    """The part of a collected test that the hooks read."""

    path: Path
    marks: list[pytest.Mark] = field(default_factory=list)
    fixturenames: tuple[str, ...] = ()
    added: list[str] = field(default_factory=list)

    @property
    def nodeid(self) -> str:
        return str(self.path)

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return next((mark for mark in self.marks if mark.name == name), None)

    def add_marker(self, marker: str | pytest.MarkDecorator) -> None:
        self.added.append(marker if isinstance(marker, str) else marker.name)


def in_folder(folder: str, *marks: pytest.MarkDecorator, fixtures: tuple[str, ...] = ()) -> pytest.Item:
    """A test in a folder under tests/."""
    found = [mark.mark for mark in marks]
    return cast(pytest.Item, Collected(ROOT / "tests" / folder / "test_x.py", found, fixtures))


ALONE = cast(pytest.Config, SimpleNamespace())
WORKER = cast(pytest.Config, SimpleNamespace(workerinput={}))
"""One of several processes, as xdist starts them."""


def test_in_one_process_cheap_folders_run_first() -> None:
    browser, unit, architecture = in_folder("browser"), in_folder("unit"), in_folder("architecture")
    plain = in_folder("integration")
    items = [browser, plain, unit, architecture]
    pytest_collection_modifyitems(ALONE, items)
    assert items == [architecture, unit, plain, browser]


def test_in_several_processes_what_takes_longest_begins_first() -> None:
    browser, unit, architecture = in_folder("browser"), in_folder("unit"), in_folder("architecture")
    plain, mission = in_folder("integration"), in_folder("integration", pytest.mark.mujoco)
    before, long = in_folder("contract"), in_folder("contract", pytest.mark.long)
    items = [unit, architecture, plain, before, long, mission, browser]
    pytest_collection_modifyitems(WORKER, items)
    assert items == [browser, before, long, mission, plain, unit, architecture]


def test_a_seventh_mission_on_real_physics_is_refused() -> None:
    allowed = [in_folder("integration", pytest.mark.mujoco) for _ in range(MUJOCO_MISSIONS)]
    pytest_collection_modifyitems(ALONE, allowed)
    with pytest.raises(pytest.UsageError, match="7 full MuJoCo missions, 6 are allowed"):
        pytest_collection_modifyitems(ALONE, [*allowed, in_folder("faults", pytest.mark.mujoco)])


def test_a_test_says_how_many_missions_it_runs() -> None:
    assert mujoco_missions(in_folder("integration", pytest.mark.mujoco(missions=3))) == 3
    assert mujoco_missions(in_folder("contract", pytest.mark.mujoco)) == 0
    assert mujoco_missions(in_folder("integration")) == 0


def test_browser_tests_and_campaigns_are_marked() -> None:
    browser, fault = in_folder("browser"), in_folder("faults", fixtures=("campaign_seed",))
    pytest_collection_modifyitems(ALONE, [browser, fault])
    assert cast(Collected, browser).added == ["browser"]
    assert cast(Collected, fault).added == ["campaign"]


def test_a_worker_in_the_place_of_one_that_died_gets_no_test_before_it_has_collected_its_own() -> None:
    scheduler, worker = object.__new__(SharedOnOneWorker), cast(WorkerController, object())
    waiting = OrderedDict({"tests/unit/test_x.py::test_x": {"tests/unit/test_x.py::test_x": False}})
    scheduler.workqueue, scheduler.registered_collections = waiting.copy(), {}
    scheduler.assigned_work = {worker: {}}
    scheduler._assign_work_unit(worker)
    assert (scheduler.workqueue, scheduler.assigned_work) == (waiting, {worker: {}})


PLAIN = "import pytest\n@pytest.mark.parametrize('n', range(6))\ndef test_x(n):\n    pass\n"
SHARED = """import os, pytest
@pytest.fixture(scope="module")
def maker():
    return os.getpid()
@pytest.mark.parametrize('n', range(6))
def test_x(n, maker):
    pass
"""


def test_browser_tests_and_a_module_that_shares_a_fixture_each_go_to_one_worker(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text("from tests.conftest import pytest_xdist_make_scheduler\n", encoding="utf-8")
    for folder, source in (("browser", PLAIN), ("unit", PLAIN), ("faults", SHARED)):
        (tmp_path / "tests" / folder).mkdir(parents=True)
        (tmp_path / "tests" / folder / f"test_{folder}.py").write_text(source, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-n", "2", "-v", "--rootdir", ".", "-p", "no:cacheprovider"]
    done = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True
    )
    passed = [line for line in done.stdout.splitlines() if "PASSED" in line]
    assert len(passed) == 18
    for folder in ("browser", "faults"):
        assert len({line.split()[0] for line in passed if f"tests/{folder}/" in line}) == 1
    begun = {line.split()[0]: line for line in reversed(passed)}
    assert sum("tests/unit/" in line for line in begun.values()) == 1, "one computes while the other waits"
