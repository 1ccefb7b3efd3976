"""Running cases: kept results are not run again, lost workers cost their case, seeds tell the same story anywhere."""

import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from multiprocessing import active_children
from pathlib import Path
from threading import Lock
from types import SimpleNamespace

import pytest

from harness.contracts.ids import Digest
from rsi_reviews.contracts import CaseResult
from rsi_reviews.regression.cases import Case, Situation, cases_of, spread
from rsi_reviews.regression.errors import ResultsDamaged, WorkersLost
from rsi_reviews.regression.executors import Executor, Here, Job, Processes, Running, failed, run_job
from rsi_reviews.regression.results import ResultsFile, evaluator_version
from rsi_reviews.regression.runner import RunProgress, measured
from rsi_reviews.regression.suite import shipped
from simulator.in_process import SIMULATOR
from tests.builders.evaluations import BASELINE, patient
from tests.saying import raises_saying

CASES = spread(tuple(c for c in cases_of(shipped("regression")) if c.situation.template == "circuit"), 6)
NINE = spread(cases_of(shipped("safety")), 9)
TRIES = 8


class Counting:
    """Runs in this process, counts what it was given, and breaks off after `most` parts."""

    def __init__(self, most: int = 10_000) -> None:
        self.ran: list[tuple[Digest, Digest]] = []
        self._most = most

    def run(self, jobs: Sequence[Job]) -> Running:
        for done, job in enumerate(_single(jobs)):
            if done == self._most:
                raise KeyboardInterrupt
            self.ran += [(case.case_id, job.configuration.configuration_id) for case in job.cases]
            yield run_job(job, SIMULATOR)


def _single(jobs: Sequence[Job]) -> Iterator[Job]:
    for job in jobs:
        yield from (Job(configuration=job.configuration, cases=(case,)) for case in job.cases)


@pytest.fixture(scope="module")
def here() -> tuple[CaseResult, ...]:
    return measured(CASES, (BASELINE,), executor=Here(SIMULATOR))


@pytest.mark.ledger("R157", symbol="rsi_reviews.regression.runner:measured")
def test_every_case_runs_under_both_configurations_on_the_same_seeds() -> None:
    results = measured(CASES[:2], (BASELINE, patient()), executor=Here(SIMULATOR))
    assert [(one.case, one.configuration) for one in results] == [
        (case.case_id, side.configuration_id) for case in CASES[:2] for side in (BASELINE, patient())
    ]
    assert {one.outcome for one in results} == {"finished"}
    assert results[0].trace == results[1].trace


def test_the_same_seed_tells_the_same_story(here: tuple[CaseResult, ...]) -> None:
    assert measured(CASES, (BASELINE,), executor=Here(SIMULATOR)) == here


def test_local_processes_give_the_same_results(here: tuple[CaseResult, ...]) -> None:
    assert measured(CASES, (BASELINE,), executor=Processes(1, SIMULATOR)) == here


def ray_cluster(*, address: str = "local") -> Executor:
    """On Ray, which is loaded where it is used: by one of the processes that collect this file."""
    cluster: Executor = import_module("rsi_reviews.regression.ray_cluster").RayCluster(address, SIMULATOR, cpus=1)
    return cluster


@pytest.mark.long
def test_ray_gives_the_same_results(here: tuple[CaseResult, ...]) -> None:
    assert measured(CASES, (BASELINE,), executor=ray_cluster()) == here


def test_a_cluster_that_is_not_there_is_a_sentence() -> None:
    with raises_saying(WorkersLost, match="Ray could not be reached"):
        measured(CASES[:1], (BASELINE,), executor=ray_cluster(address="127.0.0.1:1"))


def test_a_node_that_ray_gives_up_is_ended_and_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    module = import_module("rsi_reviews.regression.ray_cluster")
    agents: list[subprocess.Popen[bytes]] = []

    def wait(self: object) -> None:
        raise TimeoutError(f"{self} timed out during startup")

    def init(**_: object) -> None:
        agents.append(subprocess.Popen(["sleep", "600"]))
        node = module.Node.__new__(module.Node)
        process = SimpleNamespace(process=agents[-1], use_valgrind=False, use_valgrind_profiler=False)
        node.all_processes, node.removal_lock = {"agent": [process]}, Lock()
        wait(node)

    monkeypatch.setattr(module.ray, "init", init)
    with raises_saying(WorkersLost, match="Ray could not be reached"):
        measured(CASES[:1], (BASELINE,), executor=ray_cluster())
    assert [agent.returncode is not None for agent in agents] == [True] * module.STARTS


def test_a_run_that_is_cut_short_goes_on_where_it_ended(tmp_path: Path, here: tuple[CaseResult, ...]) -> None:
    path = tmp_path / "results.jsonl"
    kept = ResultsFile(path, evaluator="e")
    with pytest.raises(KeyboardInterrupt):
        measured(CASES, (BASELINE,), executor=Counting(most=4), file=kept)
    body = path.read_bytes()
    path.write_bytes(body[:-20])
    again, rest = ResultsFile(path, evaluator="e"), Counting()
    assert len(again) == 3
    assert measured(CASES, (BASELINE,), executor=rest, file=again) == here
    assert len(rest.ran) == 3
    assert len(ResultsFile(path, evaluator="e")) == 6


def test_results_of_another_evaluator_are_not_mixed_in(tmp_path: Path) -> None:
    ResultsFile(tmp_path / "r.jsonl", evaluator="one")
    with raises_saying(ResultsDamaged, match="measured by one"):
        ResultsFile(tmp_path / "r.jsonl", evaluator="two")


def test_a_line_in_the_middle_that_cannot_be_read_stops_the_run(tmp_path: Path) -> None:
    path = tmp_path / "r.jsonl"
    ResultsFile(path, evaluator="e")
    path.write_bytes(path.read_bytes() + b'{"case": NaN}\n')
    with raises_saying(ResultsDamaged, match="Line 2"):
        ResultsFile(path, evaluator="e")


def test_the_evaluator_is_named_by_its_sources() -> None:
    assert evaluator_version(SIMULATOR.sources()) == evaluator_version(SIMULATOR.sources())
    assert evaluator_version(SIMULATOR.sources()).startswith("regression-1+")


def test_a_case_that_crashed_is_not_kept(tmp_path: Path) -> None:
    kept = ResultsFile(tmp_path / "r.jsonl", evaluator="e")
    unknown = Case(situation=Situation(family="nominal", template="no such template"), seed=1)
    (result,) = measured((unknown,), (BASELINE,), executor=Here(SIMULATOR), file=kept)
    assert result.outcome == "crashed"
    assert "no such template" in result.note
    assert len(kept) == 0


def test_progress_counts_what_was_there_and_what_is_bad() -> None:
    seen: list[RunProgress] = []
    unknown = Case(situation=Situation(family="nominal", template="no such template"), seed=1)
    measured((CASES[0], unknown), (BASELINE,), executor=Here(SIMULATOR), watch=seen.append)
    assert (seen[0].done, seen[-1].done, seen[-1].of, seen[-1].bad) == (0, 2, 2, 1)


def test_a_result_that_never_came_back_is_no_measurement() -> None:
    class Silent:
        def run(self, jobs: Sequence[Job]) -> Running:
            yield ()

    (result,) = measured(CASES[:1], (BASELINE,), executor=Silent())
    assert result.outcome == "crashed"


def test_a_worker_that_cannot_import_is_a_typed_error_and_no_hang() -> None:
    """The program is started from a text that a new interpreter cannot import again."""
    words = "from tests.unit.rsi_regression.test_runner import start_a_worker; start_a_worker()"
    run = subprocess.run([sys.executable, "-"], input=words, capture_output=True, text=True, timeout=200, check=False)
    assert "WorkersLost: worker_ended_at_once" in run.stderr


def start_a_worker() -> None:
    measured(CASES[:1], (BASELINE,), executor=Processes(1, SIMULATOR))


def test_a_worker_that_is_silent_costs_its_case() -> None:
    assert lost(lambda: measured(CASES[:1], (BASELINE,), executor=Processes(1, SIMULATOR, longest_s=1e-6))) == {
        "timed_out": 1
    }


def test_a_worker_that_dies_costs_its_case_and_no_other() -> None:
    def kill(advance: RunProgress) -> None:
        if advance.done == 8:
            next(one for one in active_children() if one.name == "regression worker").kill()

    counted = lost(lambda: measured(NINE, (BASELINE,), executor=Processes(1, SIMULATOR), watch=kill))
    assert counted == {"finished": 8, "crashed": 1}


def lost(run: Callable[[], Sequence[CaseResult]]) -> Counter[str]:
    """Outcomes of the first run that lost a case: a worker may have its case done before it is let go of or killed."""
    for _ in range(TRIES):
        counted = Counter(one.outcome for one in run())
        if set(counted) != {"finished"}:
            return counted
    raise AssertionError(f"no case was lost in {TRIES} runs")


def test_a_job_runs_each_of_its_cases_even_after_one_that_crashed() -> None:
    unknown = Case(situation=Situation(family="nominal", template="no such template"), seed=1)
    results = run_job(Job(configuration=BASELINE, cases=(unknown, CASES[0])), SIMULATOR)
    assert [one.outcome for one in results] == ["crashed", "finished"]


def test_a_failed_case_says_which_case_it_was() -> None:
    result = failed(CASES[0], BASELINE, outcome="timed_out", note="x" * 900)
    assert (result.case, result.outcome, len(result.note)) == (CASES[0].case_id, "timed_out", 500)
