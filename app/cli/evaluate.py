"""regen evaluate: the evaluation protocol: arms, faults, ablations and both check suites, judged from outside."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import httpx
import msgspec
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from app.cli.output import Json, show, table
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because
from rsi_reviews.evaluation import report
from rsi_reviews.evaluation.arms import ARMS, arm
from rsi_reviews.evaluation.measures import Cell
from rsi_reviews.evaluation.missions import CONDITIONS, condition
from rsi_reviews.evaluation.plots import plots
from rsi_reviews.evaluation.protocol import ROOT, ProtocolRequest, code, rows
from rsi_reviews.evaluation.roles import ADVERSARIAL, CONTROLS, Model, RoleReport, adversarial, ask_model
from rsi_reviews.evaluation.suites import checks
from simulator.in_process import SIMULATOR

RESULTS = ROOT / "docs" / "results" / "evaluation.json"
PAGE = ROOT / "docs" / "evaluation.md"
PLOTS = ROOT / "docs" / "evaluation"
MODEL_S = 60.0
MOST_TOKENS = 128
"""A verdict and its reason need no more."""
KEY = "REGEN_MODEL_KEY"


def evaluate(
    missions: Annotated[int, typer.Option("--missions", min=1, max=100_000, help="Missions per cell.")] = 40,
    seed: Annotated[int, typer.Option("--seed", min=0, max=1_000_000, help="Every row is made again by its seed.")] = 1,
    arms: Annotated[str, typer.Option("--arms", help="Names, separated by commas; all without it.")] = "",
    faults: Annotated[str, typer.Option("--faults", help="Fault conditions, by commas; all without it.")] = "",
    processes: Annotated[int, typer.Option("--processes", min=1, max=256)] = 2,
    results_file: Annotated[
        Path | None, typer.Option("--kept", help="A file of finished missions: what is in it is not run again.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", help="Write the whole result there, as JSON.")] = None,
    model: Annotated[str, typer.Option("--model", help="A model as verifier, for the ablation of role contexts.")] = "",
    model_url: Annotated[
        str, typer.Option("--model-url", help=f"Its OpenAI-compatible endpoint, up to /v1; a key is read from {KEY}.")
    ] = "",
    model_trials: Annotated[
        int, typer.Option("--model-trials", min=1, max=10_000, help="Trials of it; a quarter as many controls beside.")
    ] = ADVERSARIAL,
    publish: Annotated[
        bool, typer.Option("--publish", help="Write docs/evaluation.md, its JSON and its plots.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Compare direct, monitored and evidence-gated execution, a behaviour tree and giving up, fault by fault."""
    if bool(model) != bool(model_url):
        raise typer.BadParameter("--model and --model-url go together")
    ask = ProtocolRequest(
        missions=missions,
        seed=seed,
        arms=_names(arms, known=[one.name for one in ARMS], check=arm),
        conditions=_names(faults, known=[one.name for one in CONDITIONS], check=condition),
    )
    with _progress() as progress:
        task = progress.add_task("missions", total=None)

        def progressed(done: int, of: int) -> None:
            progress.update(task, completed=done, total=of)

        judged = rows(ask, SIMULATOR, processes=processes, results=results_file, progress=progressed)
        roles = _roles(progress, model=model, url=model_url, trials=model_trials)
        found = report.evaluation(judged, ask, code=code(SIMULATOR), roles=roles, suites=checks(seed, SIMULATOR))
    if output is not None:
        report.save(found, output)
    if publish:
        _publish(found)
    show(json.loads(msgspec.json.encode(found)), as_json=as_json, lines=_lines(found))
    if not all(check.holds for check in found.suites):
        raise typer.Exit(1)


def _names(text: str, *, known: list[str], check: Callable[[str], Any]) -> tuple[str, ...]:
    """The names asked for, in the order in which they are known; raises UnknownName."""
    chosen = [word.strip() for word in text.split(",") if word.strip()]
    for word in chosen:
        check(word)
    return tuple(name for name in known if name in chosen or not chosen)


def _progress() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, transient=True)


def _roles(progress: Progress, *, model: str, url: str, trials: int) -> RoleReport:
    if not model:
        return RoleReport(tested=False)
    questions = adversarial(SIMULATOR, trials=trials, controls=max(1, trials * CONTROLS // ADVERSARIAL))
    task = progress.add_task(f"{model} as verifier", total=len(questions))
    with httpx.Client(timeout=MODEL_S) as client:
        return ask_model(
            questions, endpoint(client, model, url), name=model, progress=lambda n: progress.update(task, completed=n)
        )


def endpoint(client: httpx.Client, model: str, url: str) -> Model:
    """Asks one question of an OpenAI-compatible endpoint, at temperature 0. Raises httpx.HTTPError, KeyError."""
    if not url.startswith(("http://", "https://")):
        raise UnknownName(because("url_invalid", url=url), where="--model-url")
    headers = {"Authorization": f"Bearer {os.environ[KEY]}"} if KEY in os.environ else {}

    def answer(prompt: str) -> str:
        messages = [{"role": "user", "content": prompt}]
        asking = {"model": model, "temperature": 0, "max_tokens": MOST_TOKENS, "messages": messages}
        reply = client.post(f"{url.rstrip('/')}/chat/completions", json=asking, headers=headers)
        reply.raise_for_status()
        return str(reply.json()["choices"][0]["message"]["content"])

    return answer


def _publish(found: report.EvaluationReport) -> None:
    report.save(found, RESULTS)
    PAGE.write_text(report.with_figures(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")
    PLOTS.mkdir(parents=True, exist_ok=True)
    for name, text in plots(found).items():
        (PLOTS / f"{name}.svg").write_text(text, encoding="utf-8")


def _lines(found: report.EvaluationReport) -> list[str]:
    head = ["condition", "arm", "n", "success", "contract false", "epistemic false", "duplicate", "handoff", "again"]
    body = [_row(one) for one in found.cells]
    suites = [[one.suite, one.name, "holds" if one.holds else "BROKEN", one.seen] for one in found.suites]
    roles = "tested" if found.roles.tested else "not tested: it needs --model and --model-url"
    return [*table([head, *body]), "", f"role-isolated contexts: {roles}", "", *table(suites)]


def _row(one: Cell) -> list[str]:
    rates = (one.success, one.contract_false, one.epistemic_false, one.duplicate_starts, one.handoff)
    return [one.condition, one.arm, str(one.n), *(report.rate_text(rate) for rate in rates), one.command]
