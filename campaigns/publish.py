"""Writes what a campaign found to docs/: figures as JSON, and the pages' tables from them."""

from typing import Any

import msgspec

from campaigns.regen import ROOT

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


def publish(result: dict[str, Any]) -> None:
    """Replace the JSON file, and the part of the page between its two marks. Raises ValueError without the marks."""
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    RESULTS.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=2) + b"\n")
    PAGE.write_text(with_figures(PAGE.read_text(encoding="utf-8"), result), encoding="utf-8")


def with_figures(page: str, result: dict[str, Any]) -> str:
    """The page with these figures in the place of the old ones."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE.name} has no place for figures: {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n{figures(result)}{END}{after}"


def figures(result: dict[str, Any]) -> str:
    """The tables in Markdown."""
    lines = [
        "",
        f"`{result['command']}`: {result['missions']:,} simulated missions, {result['dispatches']:,} dispatches, "
        f"{result['starts']:,} physical starts, {result['commits']:,} commits, {result['rejections']:,} rejections. "
        f"In {result['missions_without_a_strike']:,} of them nothing that was planned came to strike.",
        "",
        "| found in the simulation | count | at most this share of missions (95 %) |",
        "|---|---|---|",
        *(
            f"| {title} | {result[name]['count']} | {result[name]['upper_bound']:.2e} |"
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
        *_others(result),
        "",
    ]
    return "\n".join(lines)


def _others(result: dict[str, Any]) -> list[str]:
    killed, raced = result["kill_campaign"], result["races"]
    held, damaged, bugs = result["suspended_holders"], result["damage"], result["planted_bugs"]
    ends = ", ".join(f"{count} {end.replace('_', ' ')}" for end, count in sorted(killed["ends"].items()))
    rows = [
        (
            "fail-points with SIGKILL",
            f"{killed['points']}, {killed['kills']} kills, {killed['second_kills']} second ones",
        ),
        ("how those missions ended", ends),
        ("races", f"{raced['rounds']} rounds of {raced['responders']}, {raced['effective']} with a winner"),
        ("suspended lease holders", f"{held['rounds']} rounds, {held['refused']} old tokens refused"),
        ("damaged folders and disks", f"{damaged['cases']} cases" + _skipped(damaged["skipped"])),
        ("planted bugs", f"{bugs['total']}, {bugs['caught']} caught"),
    ]
    offences = sum(len(one["offences"]) for one in (killed, raced, held, damaged))
    rows.append(("offences in all of these", str(offences)))
    table = ["| other campaigns | |", "|---|---|", *(f"| {name} | {text} |" for name, text in rows), ""]
    seen = [f"| {name} | {text} |" for name, text in bugs["seen"].items()]
    return [*table, "| planted bug | what gave it away |", "|---|---|", *seen]


def _skipped(names: list[str]) -> str:
    return f"; not to be brought about here: {', '.join(names)}" if names else ""
