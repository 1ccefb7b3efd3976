"""The conformance kit: tries every row of the lifecycle contract against one provider, each on a fresh bench."""

from collections.abc import Callable, Sequence

from harness.conformance.conformance_file import ConformanceFile
from harness.conformance.findings import UNTYPED, ConformanceFinding, ConformanceResult
from harness.conformance.rows import NAMES, ROWS, ConformanceRule
from harness.conformance.subject import Stand
from harness.conformance.test_bench import Bench, Log
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because

FIRST_TOKEN = 1
"""The first token that a lease stream gives out: what requests carry where none was given out yet."""


def check(
    stand: Stand,
    declaration: ConformanceFile,
    *,
    mission_id: MissionId,
    fencing: int = FIRST_TOKEN,
    rows: Sequence[ConformanceRule] = ROWS,
    watch: Callable[[ConformanceFinding], None] = lambda finding: None,
) -> ConformanceResult:
    """Try every row; a row that the file exempts is not tried, unless the card binds the provider to it.

    `mission_id` names this check and was never used before. Raises ContractInvalid for a file with unknown rows, and
    what `stand` raises if there is no provider to try.
    """
    strange = sorted({*declaration.meets, *declaration.exempt} - set(NAMES))
    if strange:
        raise ContractInvalid(
            because("conformance_rows_unknown", rows=tuple(strange), known=tuple(NAMES)),
            where=because("at_conformance_file", provider_id=declaration.provider_id),
        )
    card, log, found = stand().provider.card, Log(), []
    for row in rows:
        reason = declaration.exempt.get(row.name, "")
        if reason and not row.binding(card):
            finding = ConformanceFinding(row=row.name, title=row.title, outcome="exempt", text=reason)
        elif reason:
            bound = because("kit_exempt_though_bound", reason=reason)
            finding = ConformanceFinding(row=row.name, title=row.title, outcome="not met", text=bound)
        else:
            finding = _trial(row, stand, declaration, log=log, mission_id=mission_id, fencing=fencing)
        watch(finding)
        found.append(finding)
    return ConformanceResult(provider_id=card.provider_id, version=card.version, card=card, findings=tuple(found))


def _trial(
    row: ConformanceRule, stand: Stand, declaration: ConformanceFile, *, log: Log, mission_id: MissionId, fencing: int
) -> ConformanceFinding:
    try:
        bench = Bench(stand(), declaration, log=log, mission_id=mission_id, fencing=fencing)
        try:
            seen = row.trial(bench)
        finally:
            bench.close()
    except HarnessError as error:
        return ConformanceFinding(
            row=row.name,
            title=row.title,
            outcome="not met",
            text=because("kit_failed", code=error.code, reason=error.located),
        )
    except UNTYPED as error:
        text = because("kit_untyped", kind=type(error).__name__, error=str(error))
        return ConformanceFinding(row=row.name, title=row.title, outcome="not met", text=text)
    return ConformanceFinding(row=row.name, title=row.title, outcome="met" if seen.met else "not met", text=seen.text)
