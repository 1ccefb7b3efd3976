"""What every test shares: markers that are checked, the order of running, one seed or many."""

import gc
import os
from collections.abc import Collection, Generator, Iterable, Iterator
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path

import hypothesis
import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

from tools.marks import complaint

hypothesis.settings.register_profile("regenharness", deadline=None)
hypothesis.settings.load_profile("regenharness")
ROOT = Path(__file__).resolve().parent.parent
MUJOCO_MISSIONS = 6
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Set before anything loads numpy, and for every process that a test starts: the threads of a pool wait busily, and
there are more test processes than processors."""
COST = {"architecture": 0, "unit": 1, "contract": 2, "replay": 3, "integration": 4, "faults": 5, "browser": 6}
WAITING = ("tests/browser/", "tests/faults/", "tests/integration/")
"""Where tests start processes and wait for them; those of the other folders compute."""


@pytest.fixture(scope="session", autouse=True)
def key_of_the_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Seal the snapshots of tests with a key of their own, here and in every process they start."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("REGEN_SNAPSHOT_KEY_FILE", str(tmp_path_factory.mktemp("key") / "installation.key"))
        yield


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real recordings: REGEN_DATA, default ../shared/data beside the project."""
    folder = Path(os.environ.get("REGEN_DATA", ROOT.parent / "shared" / "data"))
    if not (folder / "INDEX.md").exists():
        pytest.skip(f"no real recordings in {folder}: set REGEN_DATA to their folder")
    return folder


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test that takes `campaign_seed` runs once for each of CAMPAIGN_MISSIONS seeds from CAMPAIGN_SEED on."""
    if "campaign_seed" in metafunc.fixturenames:
        first, missions = int(os.environ.get("CAMPAIGN_SEED", "1")), int(os.environ.get("CAMPAIGN_MISSIONS", "1"))
        metafunc.parametrize("campaign_seed", range(first, first + missions))


class SharedOnOneWorker(LoadScopeScheduling):
    """Gives one worker all browser tests, and a module whose tests share a fixture; the rest goes test by test.

    One worker takes the tests that compute first: the processors are never left to tests that wait.
    """

    def _assign_work_unit(self, node: WorkerController) -> None:
        if node not in self.registered_collections:
            return  # a worker in the place of one that died: it is asked again once it has collected its tests
        waiting = node is not self.nodes[-1]
        for scope in self.workqueue:
            if scope.startswith(WAITING) is waiting:
                self.workqueue.move_to_end(scope, last=False)
                break
        super()._assign_work_unit(node)

    def _split_scope(self, nodeid: str) -> str:
        if nodeid.startswith("tests/browser/"):
            return "tests/browser/"
        file, _, _ = nodeid.partition("::")
        return file if shares(file) else nodeid


@cache
def shares(file: str) -> bool:
    """Whether the tests of a file share what one of them made: two workers would both make it."""
    return 'scope="module"' in Path(file).read_text(encoding="utf-8")


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> SharedOnOneWorker:
    """Chromium takes more than one processor where two workers drive it at once. The order is that of
    `begins`, not the number of tests in a module.
    """
    config.option.loadscopereorder = False
    return SharedOnOneWorker(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """What collecting makes stays to the end: garbage is neither looked for meanwhile nor ever in it afterwards."""
    gc.disable()
    share = getattr(session.config, "workerinput", None)
    if share is not None and session.config.args == ["tests"]:
        load_share(int(share["workerid"].removeprefix("gw")), int(share["workercount"]))
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def load_share(number: int, workers: int) -> None:
    """Load one part of the modules, which compiles them where nothing is compiled: each process another part first."""
    files = sorted(file.relative_to(ROOT) for file in ROOT.glob("tests/**/test_*.py"))
    for file in files[number::workers]:
        with suppress(Exception, pytest.skip.Exception):  # collecting tells what does not load
            import_module(".".join(file.with_suffix("").parts))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark campaigns and browser tests, count the missions on real physics, order the tests."""
    for item in items:
        if "campaign_seed" in getattr(item, "fixturenames", ()):
            item.add_marker("campaign")
        if room(item) == "browser":
            item.add_marker("browser")
    missions = sum(map(mujoco_missions, items))
    if missions > MUJOCO_MISSIONS:
        tests = "\n  ".join(item.nodeid for item in items if mujoco_missions(item))
        raise pytest.UsageError(f"{missions} full MuJoCo missions, {MUJOCO_MISSIONS} are allowed:\n  {tests}")
    long = {item.path for item in items if item.get_closest_marker("long") is not None}
    items.sort(key=partial(begins, long=long) if hasattr(config, "workerinput") else cost)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """A ledger mark that names no row, or nothing that exists, fails its own test."""
    for mark in item.iter_markers("ledger"):
        wrong = complaint(mark.args, mark.kwargs)
        if wrong:
            pytest.fail(wrong, pytrace=False)


def room(item: pytest.Item) -> str:
    """The folder under tests/ that the test stands in."""
    parts: Iterable[str] = item.path.relative_to(ROOT).parts
    return [*parts, ""][1]


def cost(item: pytest.Item) -> int:
    """The order of running in one process: folders from the cheapest on."""
    return COST.get(room(item), 3)


def begins(item: pytest.Item, *, long: Collection[Path]) -> tuple[int, int, int]:
    """The order of running in several processes: what takes longest first, so that no worker is left alone with it.

    Of `long`, the modules with a long test, all tests begin early, so that those of a module stay in order.
    """
    first = 0 if room(item) == "browser" else 1 if item.path in long else 2
    return (first, -cost(item), -mujoco_missions(item))


def mujoco_missions(item: pytest.Item) -> int:
    """How many full missions on real physics a test declares to run."""
    mark = item.get_closest_marker("mujoco")
    if mark is None:
        return 0
    return int(mark.kwargs.get("missions", 0 if room(item) in {"unit", "contract"} else 1))
