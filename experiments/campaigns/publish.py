"""Writes a campaign's results to docs/: figures as JSON, and the pages' tables from them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from experiments.campaigns.regen import ROOT

RESULTS = ROOT / "docs" / "results" / "reliability.json"
PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- figures: written by `make campaign` -->", "<!-- end of figures -->"
COUNTS = {
    "contract_false_completions": "contract false completions: accepted although the evidence contradicted it",
    "epistemic_false_completions": "epistemic false completions: all sensors agreed, the truth differed",
    "false_rejections": "false rejections: truly done, not accepted on its evidence",
    "duplicate_starts": "duplicate physical starts",
    "unauthorised_commits": "commits without a satisfied, identity- and version-matched verdict",
    "other_breaches": "other breaches: budgets, leases, answers, escaped errors, endless missions",
}


def publish(result: dict[str, Any], *, page: Path = PAGE, results: Path = RESULTS) -> None:
    """Replace the JSON file, and the part of the page between its two marks. Raises ValueError without the marks.

    For a run of one campaign only, the others' figures stay unchanged; `made_by` names the run that made each, and
    `command` is the command that reproduces the simulation's figures.
    """
    results.parent.mkdir(parents=True, exist_ok=True)
    before = stored_figures(results)
    made_by = {**before.get("made_by", {}), **result["made_by"]}
    result = {**before, **result, "made_by": made_by}
    if "simulation" in made_by:
        result["command"] = made_by["simulation"]["command"]
    results.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=2) + b"\n")
    page.write_text(with_figures(page.read_text(encoding="utf-8"), result), encoding="utf-8")


def stored_figures(results: Path = RESULTS) -> dict[str, Any]:
    """The figures that stand; none without the file."""
    found: dict[str, Any] = msgspec.json.decode(results.read_bytes()) if results.exists() else {}
    return found


def with_figures(page: str, result: dict[str, Any]) -> str:
    """The page with these figures in the place of the old ones."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE.name} has no place for figures: {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n{figures(result)}{END}{after}"


def figures(result: dict[str, Any]) -> str:
    """The tables in Markdown, one for each campaign that was run."""
    return "\n".join(["", *_simulated(result), *_others(result), *_bugs(result), *_made_by(result), ""])


def _simulated(result: dict[str, Any]) -> list[str]:
    if "faults_struck" not in result:
        return []
    return [
        f"{result['missions']:,} simulated missions, {result['dispatches']:,} dispatches, "
        f"{result['starts']:,} physical starts, {result['commits']:,} commits, {result['rejections']:,} rejections. "
        f"In {result['missions_without_a_strike']:,} of them nothing that was planned came to strike.",
        "",
        "| found in the simulation | count | at most this share of missions (95 %) |",
        "|---|---|---|",
        *(
            f"| {title} | {result[name]['count']:,} | {result[name]['upper_bound']:.2e} |"
            for name, title in COUNTS.items()
        ),
        "",
        "| what struck | times | in missions |",
        "|---|---|---|",
        *(
            f"| {name} | {times:,} | {result['missions_struck'][name]:,} |"
            for name, times in result["faults_struck"].items()
        ),
        "",
    ]


def _others(result: dict[str, Any]) -> list[str]:
    rows = [row for name, table in CAMPAIGNS.items() if (found := result.get(name)) is not None for row in table(found)]
    return [*(["| other campaigns | |", "|---|---|"] if rows else []), *(f"| {a} | {b} |" for a, b in rows), ""]


def _kills(kills: dict[str, Any]) -> list[tuple[str, str]]:
    ends = ", ".join(f"{count} {end.replace('_', ' ')}" for end, count in sorted(kills["ends"].items()))
    struck = f"{kills['points']}, {kills['kills']} kills, {kills['second_kills']} second ones{_offences(kills)}"
    return [("fail-points with SIGKILL", struck), ("how those missions ended", ends)]


def _random_kills(kills: dict[str, Any]) -> list[tuple[str, str]]:
    counts = f"{kills['false_completions']} false completions, {kills['lost_events']} of {kills['read_events']:,} "
    counts += f"read events lost, {kills['duplicate_starts']} starts doubled{_offences(kills)}"
    struck = kills["instants"] - kills["missed"]
    rows = [("SIGKILL at random instants over HTTP", f"{struck} of {kills['instants']} struck: {counts}")]
    for name, found in kills["targets"].items():
        questions = ", ".join(f"{times} about {about}" for about, times in sorted(found["questions"].items()))
        ends = ", ".join(f"{times} {end.replace('_', ' ')}" for end, times in sorted(found["ends"].items()))
        alone = f"{found['succeeded']} of {found['struck']} succeeded without a person ({ends})"
        rows.append((f"after a kill of the {name}", alone + (f"; asked {questions}" if questions else "")))
    return rows


def _hard_faults(found: dict[str, Any]) -> list[tuple[str, str]]:
    counts = f"{found['false_completions']} false completions, {found['lost_events']} read events lost, "
    counts += f"{found['duplicate_starts']} starts doubled{_skipped(found['skipped'])}{_offences(found)}"
    alone = ", ".join(f"{name} {found['succeeded'].get(name, 0)} of {n}" for name, n in found["struck"].items())
    return [
        ("faults of the machine under a live mission", f"{found['missions']} missions: {counts}"),
        ("of those, succeeded without a person", alone),
    ]


def _raced(title: str) -> Callable[[dict[str, Any]], list[tuple[str, str]]]:
    def rows(raced: dict[str, Any]) -> list[tuple[str, str]]:
        rounds = f"{raced['rounds']:,} rounds of {raced['responders']}, {raced['effective']:,} with a winner"
        return [(title, rounds + _offences(raced))]

    return rows


def _suspended(held: dict[str, Any]) -> list[tuple[str, str]]:
    refused = f"{held['rounds']} rounds, {held['refused']} old tokens refused{_offences(held)}"
    return [("suspended lease holders", refused)]


def _damage(damaged: dict[str, Any]) -> list[tuple[str, str]]:
    cases = f"{damaged['cases']} cases{_skipped(damaged['skipped'])}{_offences(damaged)}"
    return [("damaged folders and disks", cases)]


def _hammered(found: dict[str, Any]) -> list[tuple[str, str]]:
    decided = f"{found['decisions']:,} acknowledged by {found['callers']} callers, {found['refusals']:,} refused"
    kills = f"{found['kills']}, {found['in_question']} between question and answer, of which {found['stood']} stood"
    summary = (
        f"{found['lost']} lost, {found['doubled']} doubled, {found['streams']:,} states from zero{_offences(found)}"
    )
    return [("gate decisions under random SIGKILL", decided), ("their kills", kills), ("those decisions", summary)]


def _work(found: dict[str, Any]) -> list[tuple[str, str]]:
    volume = f"{found['missions']:,} by {found['workers']} workers with {found['robots']} robots"
    ends = ", ".join(f"{count} {end.replace('_', ' ')}" for end, count in found["ends"].items())
    away = f"{found['restarts']} restarts ({found['crashes']} crashes), met {found['outages']} times by a worker"
    leases = f"{found['dispatches']:,} dispatches, {found['foreign_leases']:,} leases taken from outside"
    summary = f"{found['lost']} lost, {found['doubled']} doubled of {found['acknowledged']:,} appends{_offences(found)}"
    return [
        ("missions on one PostgreSQL", f"{volume}: {ends}"),
        ("its outages", f"{away}, in {found['seconds']:.0f} s"),
        ("its leases", f"{leases}, {found['contended']:,} refused: somebody else had it"),
        ("what was acknowledged", summary),
    ]


CAMPAIGNS = {
    "kill_campaign": _kills,
    "random_kills": _random_kills,
    "hard_faults": _hard_faults,
    "races": _raced("races of answers and appends"),
    "rivals": _raced("races of approvals with their rivals"),
    "release_races": _raced("races at the release desk"),
    "suspended_holders": _suspended,
    "damage": _damage,
    "hammer": _hammered,
    "workers": _work,
}


def _offences(found: dict[str, Any]) -> str:
    count = len(found["offences"])
    return f", {count} offences" if count else ", no offence"


def _bugs(result: dict[str, Any]) -> list[str]:
    bugs = result.get("planted_bugs")
    if bugs is None:
        return []
    seen = [f"| {name} | {text} |" for name, text in bugs["seen"].items()]
    title = f"| {bugs['caught']} of {bugs['total']} planted bugs caught | what gave it away |"
    return [title, "|---|---|", *seen, ""]


def _made_by(result: dict[str, Any]) -> list[str]:
    """Which run made which figures: a campaign may have been run by itself."""
    made = result.get("made_by", {})
    lines = [f"| {name} | `{by['command']}` | `{by['code'][:12]}` |" for name, by in made.items()]
    return [*(["| campaign | made by | on code |", "|---|---|---|"] if lines else []), *lines]


def _skipped(names: list[str]) -> str:
    return f"; not to be brought about here: {', '.join(names)}" if names else ""
