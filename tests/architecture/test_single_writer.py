"""Checks that only the gate appends to the log and only the supervisor commands a provider."""

import pytest

from tests.architecture.callers import EVENT_STORE, PROVIDER, Guard, forwarded, touches
from tests.architecture.sources import PACKAGES, Module, module, modules

APPENDS = ("harness/gate/commit.py",)
DISPATCHES = ("harness/supervisor/",)
# The robot's own side of the protocol, and the two exemptions that are named.
PROVIDERS_THEMSELVES = (
    "harness/adapters/providers/",
    "harness/conformance/",
    "harness/provider_protocol/",
    "rsi_reviews/evaluation/",
    "simulator/",
)


def offences(sources: tuple[Module, ...], guard: Guard, *, allowed: tuple[str, ...]) -> list[str]:
    """`path:line text` of every guarded use outside the allowed paths; adapters may forward the call they decorate."""
    found = []
    for source in sources:
        if source.path.startswith(allowed):
            continue
        passed_on = forwarded(source, guard) if source.path.startswith("harness/adapters/") else frozenset()
        found += [f"{source.path}:{line} {text}" for line, text in touches(source, guard) if line not in passed_on]
    return found


@pytest.mark.ledger("R32", planted="harness.adapters.providers.local:store.append([], [], None)")
def test_only_the_gate_appends() -> None:
    assert offences(modules(*PACKAGES), EVENT_STORE, allowed=APPENDS) == []


@pytest.mark.ledger("R78", planted="harness.routing:provider.start(None)")
def test_only_the_supervisor_commands_providers() -> None:
    assert offences(modules(*PACKAGES), PROVIDER, allowed=(*DISPATCHES, *PROVIDERS_THEMSELVES)) == []


@pytest.mark.parametrize(
    "text",
    [
        "def f(store):\n    store.append([])",
        "def f(self):\n    self._event_store.append([])",
        "def f(log: EventStore):\n    write = log.append",
        "class A:\n    def __init__(self, log: EventStore): ...\n    def f(self):\n        self._log.append(1)",
        "def f(harness):\n    harness.store().append([])",
    ],
)
def test_an_append_anywhere_else_is_found(text: str) -> None:
    assert len(offences((module("harness/memory/x.py", text),), EVENT_STORE, allowed=APPENDS)) == 1


@pytest.mark.parametrize(
    "text",
    [
        "def f(provider):\n    provider.start(r)",
        "def f(self):\n    self.providers[name].stop(h)",
        "def f(robot):\n    [p.keepalive(h) for p in robot.providers()]",
        "def f(worker: Provider):\n    worker.resume(h)",
        "def f(self):\n    self._provider_of(x).start(r)",
    ],
)
def test_a_dispatch_anywhere_else_is_found(text: str) -> None:
    assert len(offences((module("app/routes/x.py", text),), PROVIDER, allowed=DISPATCHES)) == 1


def test_lists_and_threads_are_no_offence() -> None:
    text = "def f(rows: list, thread):\n    rows.append(1)\n    thread.start()\n    stores.append(2)"
    assert offences((module("harness/memory/x.py", text),), EVENT_STORE, allowed=APPENDS) == []
    assert offences((module("harness/memory/x.py", text),), PROVIDER, allowed=DISPATCHES) == []


def test_a_decorated_store_may_pass_the_call_on_but_only_as_itself() -> None:
    text = "class S:\n def append(self, b):\n  return self._store.append(b)\n def f(self):\n  self._store.append(1)"
    found = offences((module("harness/adapters/failpoints.py", text),), EVENT_STORE, allowed=APPENDS)
    assert found == ["harness/adapters/failpoints.py:5 self._store.append"]
