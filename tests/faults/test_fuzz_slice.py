"""A slice of the fuzz campaign: changed files are read or refused with a reason, by every parser of foreign bytes."""

import pytest

from experiments.campaigns.fuzz import PARSERS, fuzz_parser


@pytest.mark.parametrize("name", sorted(PARSERS))
def test_a_parser_reads_changed_files_or_refuses_them(name: str) -> None:
    report = fuzz_parser(PARSERS[name], seed=1, files=40)
    assert report.offences == []
    assert report.read + report.refused + report.limited == report.tried == 40
