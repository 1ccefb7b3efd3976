"""A mypy plugin: a call that starts or steers a provider outside the supervisor is a type error (R78).

It goes by the receiver's type, so it makes no difference what the receiver is called or where it came from. A provider
is whatever has the members of `harness.contracts.ports.Provider`.
"""

from collections.abc import Callable

from mypy.checker import TypeChecker
from mypy.plugin import MethodContext, Plugin
from mypy.types import Instance, Type, get_proper_type

COMMANDS = frozenset({"start", "stop", "resume", "keepalive"})
MEMBERS = ("card", "start", "report", "find", "keepalive", "resume", "stop")
MAY = (
    "harness.supervisor.",
    "harness.adapters.failpoints",
    "harness.adapters.providers.",
    "harness.conformance.",
    "harness.provider_protocol.",
    "rsi_reviews.evaluation.",
    "simulator.",
    "experiments.",
)
"""The supervisor; providers, their wrappers and their side of the protocol; the kit; arms that are compared with it."""


class DispatchPlugin(Plugin):
    """Looks at every call of a method with the name of a command."""

    def get_method_hook(self, fullname: str) -> Callable[[MethodContext], Type] | None:
        """The check, for methods named like a provider's commands."""
        return refuse_dispatch if fullname.rpartition(".")[2] in COMMANDS else None


def refuse_dispatch(context: MethodContext) -> Type:
    """Report a call on a provider from a module that may not dispatch."""
    receiver = get_proper_type(context.type)
    checker = context.api
    assert isinstance(checker, TypeChecker)
    module = checker.tree.fullname
    commands = isinstance(receiver, Instance) and all(receiver.type.get(name) for name in MEMBERS)
    if commands and not module.startswith(MAY):
        context.api.fail(f"{module} commands a provider around the supervisor", context.context)
    return context.default_return_type


def plugin(version: str) -> type[Plugin]:
    """mypy's entry point."""
    return DispatchPlugin
