"""A worker does its step again and again, goes on after a step that failed, and ends when it is closed."""

from threading import Event

from harness.contracts.errors import StoreUnavailable
from harness.workers import Worker


def test_a_step_that_fails_is_followed_by_the_next() -> None:
    steps, again = [], Event()

    def step() -> None:
        steps.append(1)
        if len(steps) == 1:
            raise StoreUnavailable("the disk is full", where="here", do="free some space")
        again.set()

    worker = Worker("test", step, every_s=0.001)
    worker.start()
    worker.start()
    assert again.wait(10.0)
    worker.close()
    worker.close()
    assert worker.closed


def test_closing_ends_a_step_that_waits() -> None:
    waiting, ended = Event(), Event()

    def step() -> None:
        waiting.set()
        assert worker.wait(60.0)
        ended.set()

    worker = Worker("test", step, every_s=0.001)
    worker.start()
    assert waiting.wait(10.0)
    worker.close()
    assert ended.is_set()


def test_a_worker_that_never_started_is_closed_all_the_same() -> None:
    worker = Worker("test", lambda: None, every_s=1.0)
    worker.close()
    assert worker.closed and not worker.started and worker.wait(60.0)
