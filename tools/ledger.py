"""Prints which requirements of docs/ledger.md a test proves, by which symbol, and which are open (`make ledger`).

Rows of the table "To prove again" are printed apart, until a test that starts at the command line, the API or a page
proves them: a test that only notices its symbol breaking does not.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping

from tools.marks import LedgerMark, LedgerRow, collected, ledger, to_prove_again


def main() -> None:
    """Print covered rows with their tests, then the open ones, then those to prove again, then the three counts."""
    rows, marks = ledger(), collected()
    claims: dict[str, list[LedgerMark]] = defaultdict(list)
    for mark in marks:
        for row in mark.rows:
            claims[row].append(mark)
    stray = sorted(set(claims) - set(rows))
    if stray:
        raise SystemExit(f"Marks name rows that docs/ledger.md does not have: {', '.join(stray)}")
    _print_covered(rows.values(), claims)
    _print_open([row for row in rows.values() if row.name not in claims])
    again = still_to_prove(claims)
    _print_again(again, rows)
    counts = [f"{kind} {_share(rows.values(), claims, kind=kind)}" for kind in ("core", "adapter")]
    print(" ".join((*counts, f"again {len(again)}")))


def still_to_prove(claims: Mapping[str, list[LedgerMark]]) -> Mapping[str, str]:
    """Rows of the table that no test from an entry point proves yet, with what it must show."""
    return {
        row: must_show
        for row, must_show in to_prove_again().items()
        if not any(mark.entry for mark in claims.get(row, ()))
    }


def _print_covered(rows: Iterable[LedgerRow], claims: dict[str, list[LedgerMark]]) -> None:
    print("Covered")
    for row in rows:
        if row.name in claims:
            print(f"  {row.name} [{row.mark}] {row.text}")
            for mark in {(m.test.partition("[")[0], m.symbol or f"planted {m.planted}"): m for m in claims[row.name]}:
                print(f"      {mark[0]}  ({mark[1]})")


def _print_open(rows: list[LedgerRow]) -> None:
    print("\nOpen")
    section = ""
    for row in rows:
        if row.section != section:
            section = row.section
            print(f"  {section}")
        print(f"    {row.name} [{row.mark}] {row.text}")


def _print_again(again: Mapping[str, str], rows: Mapping[str, LedgerRow]) -> None:
    print("\nTo prove again")
    for row, must_show in again.items():
        print(f"  {row} [{rows[row].mark}] {rows[row].text}")
        print(f"      a test must show: {must_show}")


def _share(rows: Iterable[LedgerRow], claims: dict[str, list[LedgerMark]], *, kind: str) -> str:
    names = [row.name for row in rows if row.mark == kind]
    return f"{sum(name in claims for name in names)}/{len(names)}"


if __name__ == "__main__":
    main()
