"""regen rsi, the machinery: the recursion experiment, counterfactual replay, and generators on stored missions."""

import json
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from app.background.evaluations import evaluator_folder
from app.cli import output
from app.i18n.reasons.rendering import stating
from app.settings import ROOT
from harness.bootstrap import read_harness
from harness.contracts.configuration import Configuration
from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.contracts.values import digest
from harness.runtime import Runtime
from rsi_reviews.candidate_queries import CandidateQueries, selected
from rsi_reviews.candidates import LARGEST_BYTES, read_configuration
from rsi_reviews.contracts import Candidate
from rsi_reviews.counterfactual import Counterfactual, counterfactual
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.process import generated_apart
from rsi_reviews.generate.trace import read_trace
from rsi_reviews.recursion.experiment import FleetOutcome, Terms
from rsi_reviews.recursion.publish import WORDS, found, publish
from rsi_reviews.recursion.run import blind_tasks, outcomes, tasks
from simulator.in_process import SIMULATOR

DOCS = ROOT / "docs"
BLIND_EACH = 2


class GeneratorChoice(StrEnum):
    """Which generator proposes."""

    miner = "miner"
    model = "model"


def recursion(
    generations: Annotated[int, typer.Option(min=1, max=50)] = 6,
    fleets: Annotated[
        int, typer.Option(min=1, max=1000, help="Independent fleets; ten make a full turn of sites.")
    ] = 30,
    missions: Annotated[int, typer.Option(min=1, max=1000, help="Held-out missions per fleet and generation.")] = 10,
    seed: Annotated[int, typer.Option(min=0, max=1_000_000, help="Every number follows from it.")] = 1,
    processes: Annotated[int, typer.Option(min=1, max=256)] = 2,
    results_folder: Annotated[
        Path, typer.Option("--kept", help="Finished fleets lie there; a run that was broken off goes on.")
    ] = Path("var/recursion"),
    blind: Annotated[
        bool, typer.Option("--blind", help="Then open the final test: sites hashed before the run.")
    ] = False,
    write: Annotated[bool, typer.Option("--publish", help="Write docs/recursion.md, its JSON and its plots.")] = False,
    as_json: output.Json = False,
) -> None:
    """Six arms over several generations on sites with hidden regularities: does the gated loop pay, and why?"""
    terms = Terms(seed=seed, generations=generations, measured=missions)
    runs = tasks(terms, fleets)
    final = blind_tasks(terms, each=BLIND_EACH) if blind else ()
    folder = results_folder / digest(terms)[:16]
    with _progress() as progress:
        task = progress.add_task("fleets", total=len(runs) + len(final))

        def advance(outcome: FleetOutcome, done: int, of: int) -> None:
            progress.update(task, advance=1, description=f"fleet {outcome.task.fleet} at {outcome.task.site}")

        every = outcomes(runs, simulator=SIMULATOR, folder=folder, processes=processes, report=advance)
        last = outcomes(final, simulator=SIMULATOR, folder=folder, processes=processes, report=advance)
    result = found(every, last, terms, fleets=fleets)
    if write:
        publish(result, docs=DOCS)
    output.show(result, as_json=as_json, lines=_lines(result))


def replayed(
    candidate: Annotated[str, typer.Argument(help="The candidate's digest, a beginning of it, or a JSON file.")],
    mission: Annotated[list[str] | None, typer.Option(help="Only this mission; may be given again.")] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Which stored routing, context and recovery decisions would differ under a candidate. No robot is touched."""
    with _stored(data) as runtime:
        configuration = _configuration(CandidateQueries(runtime), candidate)
        chosen = [MissionId(name) for name in mission] if mission else None
        report = counterfactual(runtime, configuration, chosen)
    output.show(stating(report), as_json=as_json, lines=_differences(report))


def generate(
    way: Annotated[
        GeneratorChoice, typer.Option("--with", help="The trace miner, or the model that REGEN_MODEL names.")
    ] = GeneratorChoice.miner,
    most: Annotated[int, typer.Option(min=1, max=20, help="How many candidates at most.")] = 3,
    into: Annotated[Path | None, typer.Option(help="Write each as NAME.json and NAME.manifest.json there.")] = None,
    evaluator: Annotated[
        Path | None,
        typer.Option(help="The evaluator's folder, which the generator cannot read; default: beside --data."),
    ] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Read what missions under the current version recorded, and propose changes. Nothing is put on record.

    The generator runs in a process that can read neither the data folder nor the evaluator's.
    """
    with _stored(data) as runtime:
        queries = CandidateQueries(runtime)
        current = runtime.stored_configuration(queries.current())
        under = [one.mission_id for one in runtime.pinned_to(queries.current())][::-1]
        trace = read_trace(runtime, under)
        seen = tuple(review.configuration for review in queries.reviews())
    budget = GenerationBudget(candidates=most, seen=seen)
    folders = (data.absolute(), evaluator or evaluator_folder(data.absolute()))
    answer = generated_apart(way.value, trace, current, budget, unreadable=folders, given=os.environ)
    candidates = answer.candidates
    written = [_write(into, one) for one in candidates] if into is not None else []
    rows = [{"candidate": one.candidate_id, "manifest": msgspec.to_builtins(one.manifest)} for one in candidates]
    lines = [f"{one.manifest.reason} {one.manifest.intended_effect}" for one in candidates]
    found = {"missions": len(trace.missions), "candidates": rows, "files": written}
    process = {"unreadable": answer.unreadable, "environment": answer.environment}
    none = [f"{len(trace.missions)} missions give no reason for a change."]
    output.show({**found, "process": process}, as_json=as_json, lines=[*lines, *written] or none)


def _stored(data: Path) -> AbstractContextManager[Runtime]:
    """The log without owning the folder."""
    return read_harness(output.settings(data_folder=data), deciders=DECIDERS, select=selected)


def _configuration(queries: CandidateQueries, candidate: str) -> Configuration:
    """A candidate on record, or a file."""
    path = Path(candidate)
    if not path.is_file():
        return queries.candidate(candidate).configuration
    try:
        with path.open("rb") as file:
            return read_configuration(file.read(LARGEST_BYTES + 1))
    except OSError as error:
        raise StoreUnavailable(because("file_unreadable", error=str(error)), where=candidate) from error


def _write(folder: Path, candidate: Candidate) -> str:
    """The two texts that `regen rsi propose` takes; returns how to call it."""
    name = candidate.candidate_id[:16]
    folder.mkdir(parents=True, exist_ok=True)
    for value, suffix in ((candidate.configuration, ".json"), (candidate.manifest, ".manifest.json")):
        (folder / f"{name}{suffix}").write_text(
            json.dumps(msgspec.to_builtins(value), indent=1) + "\n", encoding="utf-8"
        )
    return f"regen rsi propose --file {folder / name}.json --manifest {folder / name}.manifest.json"


def _progress() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, transient=True)


def _lines(result: Any) -> list[str]:
    last = max((row["generation"] for row in result["rows"]), default=0)
    head = ["arm", "n", "verified", "cost", "handoffs", "false", "proposed", "accepted"]
    body = [
        [row["arm"], str(row["n"]), _cell(row, "verified_completion"), _cell(row, "recovery_cost"),
         _cell(row, "handoffs"), _cell(row, "false_completion"), str(row["proposed"]), str(row["accepted"])]
        for row in result["rows"] if row["generation"] == last
    ]  # fmt: skip
    return [*output.table([head, *body]), "", *(_answer(one) for one in result["answers"])]


def _cell(row: dict[str, Any], name: str) -> str:
    low, high = row[f"{name}_ci"]
    return f"{row[name]:.3f} ({low:.3f}..{high:.3f})"


def _answer(one: dict[str, Any]) -> str:
    return f"{WORDS[one['refuted']]}: {one['refutes']}. {one['sentence']}"


def _differences(report: Counterfactual) -> list[str]:
    lines = []
    for mission in report.differing:
        lines.append(f"{mission.mission_id}  {mission.template}  {mission.status}")
        rows: Sequence[Sequence[str]] = [
            [f"  {one.position}", one.kind, one.node_id, f"{one.before} -> {one.after}"] for one in mission.differences
        ]
        lines += output.table(rows)
    derived = sum(sum(mission.derived.values()) for mission in report.missions)
    unreadable = sum(len(mission.unreadable) for mission in report.missions)
    lines.append(
        f"{len(report.differing)} of {len(report.missions)} missions would have gone another way; "
        f"{derived} decisions derived again, {unreadable} could not be."
    )
    return lines
