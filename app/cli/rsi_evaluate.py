"""regen rsi evaluate: run a candidate and its baseline on the suites, judge it, and record the result.

Beside a running console the console evaluates it, and this command follows. Else it runs here: Ctrl-C keeps every
finished case, and the same command goes on from there. Exit 0 passed, 1 not, 130 broken off.
"""

import os
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.acts.releases import CancelEvaluationAct, EvaluateCandidateAct
from app.cli import output
from app.cli.data_folder import deciding
from app.cli.logins import acting_name
from app.cli.owner_api import OwnerApi, owner_api
from app.cli.person import me
from app.cli.rsi import CandidateName
from harness.bootstrap import read_harness
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid, HarnessError, StoreOwned
from harness.contracts.reasons import because
from harness.contracts.values import digest
from rsi_reviews.candidate_queries import CandidateQueries, selected
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.evaluation_jobs import OPEN
from rsi_reviews.held_out import Looks, secret_in
from rsi_reviews.regression.executors import Executor, local
from rsi_reviews.regression.grown_suite import with_growth
from rsi_reviews.regression.results import ResultsFile, evaluator_version, results_path
from rsi_reviews.regression.runner import RunProgress
from rsi_reviews.regression.suite import shipped
from rsi_reviews.release_service import ReleaseService, SignedBy
from rsi_reviews.trial import HeldOut, Means, Trial, TrialOutcome, carried_out, judged_on, prepared
from simulator.in_process import SIMULATOR

FOLLOW_S = 1.0
EvaluatorFolder = Annotated[
    Path | None,
    typer.Option(
        "--evaluator",
        help="Where secret, looks and kept results lie; beside the data folder if not given.",
        envvar="REGEN_EVALUATOR_FOLDER",
    ),
]


@dataclass(frozen=True)
class RunOptions:
    """What a person said about how to run it."""

    data: Path
    folder: Path
    cases: int | None
    fresh: bool


def evaluate(
    candidate: CandidateName,
    data: output.Data = output.DEFAULT_DATA,
    evaluator: EvaluatorFolder = None,
    ray: Annotated[str, typer.Option(help="A Ray cluster's address, or `local`; local processes if not given.")] = "",
    processes: Annotated[int, typer.Option(help="Local processes; 0 runs in this one.")] = os.cpu_count() or 1,
    cases: Annotated[
        int | None, typer.Option(help="A quick look at so many cases of each suite; decides nothing.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume/--fresh", help="Go on with kept results, or run all again.")] = True,
    as_json: output.Json = False,
) -> None:
    """Compare a candidate with its baseline on the shipped suites and put the report on record."""
    folder = evaluator or data.absolute().with_name(f"{data.absolute().name}-evaluator")
    how = RunOptions(data=data, folder=folder, cases=cases, fresh=not resume)
    owner = owner_api(data) if cases is None else None
    if owner is not None and evaluator is None and not ray and resume:
        raise typer.Exit(_in_console(owner, candidate, processes, as_json=as_json))
    if owner is not None:
        raise StoreOwned(because("console_owns_folder"), where=str(data))
    trial = _trial(candidate, how)
    if cases is None:
        _recorded(how, lambda releases: releases.begin(trial.terms, _signed(trial, "begin")))
    outcome = _run(trial, how, executor(ray, processes))
    if cases is None:
        _recorded(
            how, lambda releases: releases.submit_results(judged_on(trial, outcome.results), _signed(trial, "results"))
        )
    answer = report_of(trial, outcome, recorded=cases is None)
    output.show(answer, as_json=as_json, lines=_lines(answer))
    raise typer.Exit(0 if answer["answer"] == "pass" else 1)


def cancel(candidate: CandidateName, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """End an evaluation of the running console, or take it out of its queue. What was measured is kept."""
    owner = owner_api(data)
    if owner is None:
        raise HarnessError(because("no_console"), where=str(data))
    answer = owner.post(f"/candidates/{candidate}/cancel-evaluation", CancelEvaluationAct().body())
    output.show(answer, as_json=as_json, lines=[f"{candidate[:16]}  {answer['job']['status']}"])


def _in_console(owner: OwnerApi, candidate: str, processes: int, *, as_json: bool) -> int:
    """Have the running console evaluate it, and follow that: 0 if it passed. Ctrl-C ends the following alone."""
    path = f"/candidates/{candidate}"
    answer = owner.post(f"{path}/evaluate", EvaluateCandidateAct.of(processes=processes).body())
    try:
        with _progress_bar() as watch:
            while answer["job"]["status"] in OPEN:
                job = answer["job"]
                watch(RunProgress(done=job["done"], of=max(1, job["of"]), kept=job["kept"], bad=job["bad"]))
                time.sleep(FOLLOW_S)
                answer = owner.get(f"{path}/evaluation")
    except KeyboardInterrupt:
        sys.stderr.write(f"regen: the console goes on; `regen rsi cancel-evaluation {candidate[:12]}` ends it\n")
        return 130
    job = answer["job"]
    why = f": {job['reason']}" if job["reason"] else ""
    output.show(answer, as_json=as_json, lines=[f"{candidate[:16]}  {job['answer'] or job['status']}{why}"])
    return 0 if job["answer"] == "pass" else 1


def executor(ray: str, processes: int) -> Executor:
    """Ray where an address is given, else local processes. Raises HarnessError if Ray is not installed."""
    if not ray:
        return local(processes, SIMULATOR)
    try:
        cluster = import_module("rsi_reviews.regression.ray_cluster")
    except ModuleNotFoundError as error:
        raise HarnessError(because("ray_missing"), where="--ray") from error
    chosen: Executor = cluster.RayCluster(ray, SIMULATOR, cpus=max(1, processes))
    return chosen


def report_of(trial: Trial, outcome: TrialOutcome, *, recorded: bool) -> dict[str, Any]:
    """The report as one JSON object."""
    results = outcome.results
    return {
        "candidate": trial.terms.candidate,
        "answer": outcome.report.answer,
        "recorded": recorded,
        "clauses": [msgspec.to_builtins(clause) for clause in outcome.report.clauses],
        "held_out": msgspec.to_builtins(results.held_out) if results.held_out else None,
        "terms": msgspec.to_builtins(trial.terms),
        "cases": len(trial.cases),
        "results": len(results.results),
        "seconds": round(results.seconds, 1),
    }


def _trial(name: str, how: RunOptions) -> Trial:
    with read_harness(output.settings(data_folder=how.data), deciders=DECIDERS, select=selected) as runtime:
        queries = CandidateQueries(runtime)
        candidate, growth = queries.candidate(name), queries.growth()
        baseline = runtime.stored_configuration(candidate.baseline)
    suites = (with_growth(shipped("regression"), growth), shipped("safety"))
    return prepared(
        candidate,
        baseline,
        suites,
        launched_by=(acting_name(how.data),),
        simulator=SIMULATOR,
        suite_edited_by=growth.hands,
        most=how.cases,
    )


def _run(trial: Trial, how: RunOptions, executor: Executor) -> TrialOutcome:
    evaluator = evaluator_version(SIMULATOR.sources())
    how.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = results_path(how.folder, evaluator)
    held_out = None
    if how.cases is None:
        held_out = HeldOut(secret=secret_in(how.folder, secrets.token_bytes), looks=Looks(how.folder))
    if how.fresh:
        path.unlink(missing_ok=True)
    results = ResultsFile(path, evaluator=evaluator)
    with _progress_bar() as watch:
        try:
            means = Means(executor=executor, now_s=time.monotonic, kept=results, held_out=held_out, watch=watch)
            return carried_out(trial, means)
        except KeyboardInterrupt:
            sys.stderr.write(f"regen: broken off; {len(results)} results are kept in {path}, run the same to go on\n")
            raise typer.Exit(130) from None


def _recorded(how: RunOptions, word: Callable[[ReleaseService], Accepted[Any] | Refused]) -> None:
    """Have the release service decide one request. Raises ContractInvalid with the rule that refused it."""
    with deciding(output.settings(data_folder=how.data)) as releases:
        decision = word(releases)
    if isinstance(decision, Refused):
        raise ContractInvalid(output.refusal(decision), do="see `regen rsi show`")


def _signed(trial: Trial, word: str) -> SignedBy:
    return SignedBy(me(), f"evaluate: {word}", f"evaluate:{word}:{digest(trial.terms)}")


@contextmanager
def _progress_bar() -> Iterator[Callable[[RunProgress], None]]:
    """A bar on standard error."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as progress:
        task = progress.add_task("missions")

        def watch(advance: RunProgress) -> None:
            bad = f", {advance.bad} without a result" if advance.bad else ""
            earlier = f" ({advance.kept} kept before)" if advance.kept else ""
            progress.update(task, completed=advance.done, total=advance.of, description=f"missions{earlier}{bad}")

        yield watch


def _lines(answer: dict[str, Any]) -> list[str]:
    lines = [f"{one['clause']}: {one['answer']}. {one['sentence']}" for one in answer["clauses"]]
    where = "on record" if answer["recorded"] else "a quick look, not on record"
    ran = f"{answer['results']} missions in {answer['seconds']} s"
    return [*lines, f"{answer['candidate'][:16]}  {answer['answer']}  {ran}, {where}"]
