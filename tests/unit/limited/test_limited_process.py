"""A parser in a limited process: its answer comes back; what exceeds a limit ends it with a typed error."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from harness.adapters.limited_process import LimitedProcess, Limits, run_limited
from harness.contracts.errors import CloudInvalid, HarnessError, RecordingInvalid
from tests.unit.limited import parsers

LIMITS = Limits(memory_bytes=64 * 2**20, cpu_s=1.0, wall_s=180.0, output_bytes=2**20)


def failure(work: Callable[[bytes], bytes], request: bytes = b"", limits: Limits = LIMITS) -> HarnessError:
    with pytest.raises(HarnessError) as raised:
        run_limited(work, request, limits, failure=RecordingInvalid, where="file.mcap")
    return raised.value


def test_one_child_answers_many_requests_and_what_it_prints_is_no_answer() -> None:
    with closing(LimitedProcess(parsers.chatty, LIMITS)) as child:
        assert [child.run(body) for body in (b"", b"one", bytes(500_000))] == [b"", b"one", bytes(500_000)]


def test_a_typed_error_of_the_parser_comes_back_as_it_was_raised() -> None:
    found = failure(parsers.refusing)
    assert isinstance(found, CloudInvalid)
    assert (found.reason.code, found.where) == ("cloud_empty", "here")


@pytest.mark.parametrize(
    ("work", "request_body", "code"),
    [
        (parsers.broken, b"", "parser_failed"),
        (parsers.greedy, b"1000000000", "parser_out_of_memory"),
        (parsers.greedy, b"3000000", "parser_output_too_large"),
        (parsers.endless, b"", "parser_out_of_time"),
        (parsers.crashing, b"", "parser_died"),
    ],
    ids=["exception", "memory", "output", "processor time", "crash"],
)
def test_what_exceeds_a_limit_is_refused_with_the_reason(
    work: Callable[[bytes], bytes], request_body: bytes, code: str
) -> None:
    found = failure(work, request_body)
    assert isinstance(found, RecordingInvalid)
    assert (found.reason.code, found.where) == (code, "file.mcap")


def test_a_parser_that_waits_is_ended() -> None:
    found = failure(parsers.asleep, limits=Limits(memory_bytes=2**26, cpu_s=60.0, wall_s=0.5, output_bytes=10))
    assert found.reason.code == "parser_out_of_time"


def test_a_file_that_it_writes_is_bounded_as_its_answer_is(tmp_path: Path) -> None:
    assert failure(parsers.writing, str(tmp_path / "out").encode()).reason.code == "parser_output_too_large"


def test_a_child_that_was_ended_is_replaced(tmp_path: Path) -> None:
    with closing(LimitedProcess(parsers.greedy, LIMITS)) as child:
        for _ in range(2):
            with pytest.raises(HarnessError):
                child.run(b"1000000000")
            assert child.run(b"10") == bytes(10)


def test_it_gets_no_secret_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REGEN_MODEL_KEY", "secret")
    names = run_limited(parsers.surroundings, b"", LIMITS).decode().split("\n")
    assert "REGEN_MODEL_KEY" not in names and "PYTHONPATH" in names
