"""The command line `regen`: the same acts as the console, for a terminal and for scripts.

Exit: 0 succeeded; 3 waits for a person or is paused; 1 any other end, or a bad file, port, folder or database;
2 a bad argument, name or contract; 4 the goal was verified in part only: something is declared and not verified.
"""

import ast
import gc
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from harness.contracts.errors import HarnessError

GROUPS = {
    "mission": "missions:app",
    "handoff": "handoffs:app",
    "lease": "leases:app",
    "alert": "alerts:app",
    "rsi": "releases:app",
    "robot": "robots:app",
    "map": "maps:app",
    "vision": "vision:app",
    "audit": "audit:app",
    "blob": "blobs:app",
    "data": "databases:app",
    "provider": "providers:app",
    "account": "accounts:account",
    "token": "accounts:token",
    "site": "site_export:app",
    "spool": "spools:app",
}
COMMANDS = {
    "up": "service:up",
    "worker": "workers:worker",
    "init": "sites:init",
    "check": "sites:check",
    "login": "logins:login",
    "logout": "logins:logout",
    "whoami": "logins:whoami",
    "verify": "dossiers:verify",
    "evaluate": "evaluate:evaluate",
    "doctor": "service:doctor",
    "mcp": "mcp_server:serve",
    "schemas": "schemas:schemas",
    "backup": "backups:backup",
    "restore": "backups:restore",
    "incident": "incidents:incident",
    "shadow": "shadow:shadow",
    "audit bags": "bag_audits:bags",
    "mission dossier": "dossier_export:dossier",
    "rsi case": "rsi_cases:case",
    "rsi evaluate": "rsi_evaluate:evaluate",
    "rsi cancel-evaluation": "rsi_evaluate:cancel",
    "rsi recursion": "rsi_recursion:recursion",
    "rsi counterfactual": "rsi_recursion:replayed",
    "rsi generate": "rsi_recursion:generate",
    "account identity": "identity:identity",
}
"""Which module of app.cli has it, and under which name there. A second word: a command beside a group's own."""


class CommandGroups(TyperGroup):
    """Imports what a command needs when it is asked for: `regen audit` waits for no web server."""

    def list_commands(self, ctx: Any) -> list[str]:
        """All of the first words."""
        return [*(name for name in COMMANDS if " " not in name), *GROUPS]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The first words with what each is for, read from the sources: importing all of them takes seconds."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, _summary({**COMMANDS, **GROUPS}[name])) for name in self.list_commands(ctx)])

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


def _summary(where: str) -> str:
    module, _, name = where.partition(":")
    source = (Path(__file__).parent / f"{module}.py").read_text(encoding="utf-8")
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return (ast.get_docstring(node) or "").partition("\n")[0]
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name and isinstance(node.value, ast.Call):
            return "".join(ast.literal_eval(one.value) for one in node.value.keywords if one.arg == "help")
        if isinstance(node, ast.ImportFrom) and name in [one.asname or one.name for one in node.names]:
            return _summary(f"{str(node.module).removeprefix('app.cli.')}:{name}")
    return ""


def _named(where: str) -> Any:
    file, _, name = where.partition(":")
    module = f"app.cli.{file}"
    if module not in sys.modules:
        gc.disable()  # what an import makes stays: looking through it for garbage takes a fifth of the start
        import_module(module)
        gc.freeze()
        gc.enable()
    return getattr(sys.modules[module], name)


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
    except HarnessError as error:
        from app.cli.output import complain  # noqa: PLC0415  what renders an error loads for half a second

        sys.exit(complain(error, as_json="--json" in sys.argv))


if __name__ == "__main__":
    main()
