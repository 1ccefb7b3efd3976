"""Runs cases under several configurations. Stored cases are not run again, and every finished case is stored at
once.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing

from harness.contracts.configuration import Configuration
from harness.contracts.values import Value
from rsi_reviews.contracts import CaseResult
from rsi_reviews.regression.cases import Case
from rsi_reviews.regression.executors import Executor, Job, failed
from rsi_reviews.regression.results import Key, ResultsFile

BATCH = 40
"""Baseline and candidate take turns in batches, so that a run that is cut short holds pairs."""


class RunProgress(Value):
    """The progress of a run. `bad` cases have no measurement; `kept` were stored before it began."""

    done: int
    of: int
    kept: int
    bad: int


Watch = Callable[[RunProgress], None]


def unwatched(advance: RunProgress) -> None:
    """Reports progress to nobody."""


def measured(
    cases: Sequence[Case],
    configurations: Sequence[Configuration],
    *,
    executor: Executor,
    file: ResultsFile | None = None,
    watch: Watch = unwatched,
) -> tuple[CaseResult, ...]:
    """One result per case and configuration, in that order; a case that was lost has a result that says so.

    Raises WorkersLost if the executor gives up. Whatever it raises, and on KeyboardInterrupt, finished cases are kept.
    """
    found = {(r.case, r.configuration): r for r in _before(cases, configurations, file)}
    before, of, bad = len(found), len(cases) * len(configurations), 0
    jobs = [
        Job(configuration=configuration, cases=part)
        for begin in range(0, len(cases), BATCH)
        for configuration in configurations
        if (part := _open(cases[begin : begin + BATCH], configuration, found))
    ]
    watch(RunProgress(done=before, of=of, kept=before, bad=0))
    with closing(executor.run(jobs)) as running:
        for results in running:
            if file is not None:
                file.add(results)
            found |= {(r.case, r.configuration): r for r in results}
            bad += sum(result.outcome != "finished" for result in results)
            watch(RunProgress(done=len(found), of=of, kept=before, bad=bad))
    return tuple(
        found.get((case.case_id, configuration.configuration_id))
        or failed(case, configuration, outcome="crashed", note="no result came back")
        for case in cases
        for configuration in configurations
    )


def _before(
    cases: Sequence[Case], configurations: Sequence[Configuration], results: ResultsFile | None
) -> list[CaseResult]:
    if results is None:
        return []
    keys = [(case.case_id, one.configuration_id) for one in configurations for case in cases]
    return [result for key in keys if (result := results.get(key)) is not None]


def _open(cases: Sequence[Case], configuration: Configuration, found: Mapping[Key, CaseResult]) -> tuple[Case, ...]:
    name = configuration.configuration_id
    return tuple(case for case in cases if (case.case_id, name) not in found)
