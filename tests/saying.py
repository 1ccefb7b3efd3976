"""What an error says to a person, in English: `pytest.raises` for errors whose sentence is made at the edge."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from click.testing import Result

from app.i18n.reasons.rendering import explained, sentence
from harness.contracts.errors import HarnessError


@contextmanager
def raises_saying(
    kind: type[HarnessError] | tuple[type[HarnessError], ...], *, match: str
) -> Iterator[pytest.ExceptionInfo[HarnessError]]:
    """Expect an error of that kind whose line for a person (what, where, what to do) matches."""
    with pytest.raises(kind) as raised:
        yield raised
    assert re.search(match, explained(raised.value)), explained(raised.value)


def where(error: HarnessError) -> str:
    """Where an error is, as a person reads it."""
    return sentence(error.where)


def said(result: Result) -> str:
    """What a command that failed says to a person."""
    assert isinstance(result.exception, HarnessError), result.output
    return explained(result.exception)
