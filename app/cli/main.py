"""The command line `regen`: the same acts as the console, for a terminal and for scripts.

Exit: 0 succeeded; 3 waits for a person or is paused; 1 any other end, or a bad file, port, folder or database;
2 a bad argument, name or contract; 4 the goal was verified in part only: something is declared and not verified.
"""

import sys
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

GROUPS = {
    "mission": "missions:app",
    "handoff": "handoffs:app",
    "lease": "leases:app",
    "alert": "alerts:app",
    "rsi": "releases:app",
    "robot": "robots:app",
    "map": "maps:app",
    "audit": "audit:app",
    "data": "databases:app",
    "provider": "providers:app",
    "account": "accounts:account",
    "token": "accounts:token",
}
COMMANDS = {
    "up": "service:up",
    "login": "logins:login",
    "logout": "logins:logout",
    "whoami": "logins:whoami",
    "verify": "dossiers:verify",
    "evaluate": "evaluate:evaluate",
    "doctor": "service:doctor",
    "backup": "backups:backup",
    "restore": "backups:restore",
    "mission dossier": "dossiers:dossier",
    "rsi case": "rsi_cases:case",
    "rsi evaluate": "rsi_evaluate:evaluate",
    "rsi recursion": "rsi_recursion:recursion",
    "rsi counterfactual": "rsi_recursion:replayed",
    "rsi generate": "rsi_recursion:generate",
    "account identity": "identity:identity",
}
"""Which module of app.cli has it, and under which name there. A second word: a command beside a group's own."""


SUMMARIES = {
    "up": "Start the console and everything behind it; prints one sign-in link.",
    "login": "Sign in to an account of this data folder: what you decide at this terminal is then that person's word.",
    "logout": "End the session of this terminal, and forget its token.",
    "whoami": "Who acts here: an account, or a user of this machine without one.",
    "verify": "Check a dossier with nothing but the file: signature, digests, chain, and every decision derived again.",
    "evaluate": "Compare direct, monitored and evidence-gated execution, a behaviour tree and giving up, "
    "fault by fault.",
    "doctor": "Look at a data folder: owner, log, blobs; and at the identity provider, if one is set up.",
    "backup": "Copy log, blobs and accounts, also while a console runs, and verify the copy.",
    "restore": "Make a new data folder from a backup: every file is compared with its digest, and the log verified.",
    "mission": "Run and read missions.",
    "handoff": "Answer the questions that missions ask people.",
    "lease": "See who holds the robot's resources; free what nobody accounts for.",
    "alert": "See what went wrong, one row per cause, and look after it.",
    "rsi": "Propose, evaluate, review, release and roll back configurations.",
    "robot": "See and stop the robots of a running console.",
    "map": "Point clouds of maps, for the 3D view.",
    "audit": "Reconstruct and check what happened.",
    "data": "Where the event log lies.",
    "provider": "See and check what can act.",
    "account": "People who may use the console.",
    "token": "Tokens for robots and integrations on the API.",
}
"""What the list of commands says of each, so that it imports none of them."""


class CommandGroups(TyperGroup):
    """Imports what a command needs when it is asked for: `regen audit` waits for no web server."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The list of commands, which imports none of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, SUMMARIES[name]) for name in self.list_commands(ctx)])

    def list_commands(self, ctx: Any) -> list[str]:
        """All of the first words."""
        return [*(name for name in COMMANDS if " " not in name), *GROUPS]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command or group of that name; None if there is none."""
        if cmd_name in GROUPS:
            group = _group(cmd_name, GROUPS[cmd_name])
            for name, where in COMMANDS.items():
                first, _, second = name.partition(" ")
                if second and first == cmd_name:
                    group.add_command(_command(second, where), second)
            return group
        return _command(cmd_name, COMMANDS[cmd_name]) if cmd_name in COMMANDS else None


def _named(where: str) -> Any:
    module, _, name = where.partition(":")
    return getattr(import_module(f"app.cli.{module}"), name)


def _group(name: str, where: str) -> Any:
    around = typer.Typer(add_completion=False, rich_markup_mode=None)
    around.add_typer(_named(where), name=name)
    return get_group(around).commands[name]


def _command(name: str, where: str) -> Any:
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(name)(_named(where))
    return get_command(alone)


app = typer.Typer(cls=CommandGroups, no_args_is_help=True, add_completion=False, help=__doc__, rich_markup_mode=None)


@app.callback()
def regen() -> None:
    """What every command shares: nothing."""


def main() -> None:
    """Entry point. A typed error becomes one sentence on standard error and an exit code."""
    try:
        app()
    except Exception as error:
        code = _named("output:complained")(error, as_json="--json" in sys.argv)
        if code is None:
            raise
        sys.exit(code)


if __name__ == "__main__":
    main()
