"""The command line `regen`: the same front door as the console, for a terminal and for scripts.

Exit: 0 succeeded; 3 waits for a person or is paused; 1 any other end, or a bad file, port, folder or database;
2 a bad argument, name or contract.
"""

import sys

import typer

from app.terminal import (
    accounts,
    alerts,
    audit,
    databases,
    dossiers,
    evaluate,
    handoffs,
    identity,
    leases,
    maps,
    missions,
    providers,
    releases,
    robots,
    rsi_cases,
    rsi_evaluate,
    rsi_recursion,
    service,
)
from app.terminal.answers import complain
from harness.contracts.errors import HarnessError

app = typer.Typer(no_args_is_help=True, add_completion=False, help=__doc__, rich_markup_mode=None)
app.add_typer(missions.app, name="mission")
missions.app.command("dossier")(dossiers.dossier)
app.add_typer(handoffs.app, name="handoff")
app.add_typer(leases.app, name="lease")
app.add_typer(alerts.app, name="alert")
app.add_typer(releases.app, name="rsi")
releases.app.command("case")(rsi_cases.case)
releases.app.command("evaluate")(rsi_evaluate.evaluate)
releases.app.command("recursion")(rsi_recursion.recursion)
releases.app.command("counterfactual")(rsi_recursion.replayed)
releases.app.command("generate")(rsi_recursion.generate)
app.add_typer(robots.app, name="robot")
app.add_typer(maps.app, name="map")
app.add_typer(audit.app, name="audit")
app.add_typer(databases.app, name="data")
app.add_typer(providers.app, name="provider")
app.add_typer(accounts.account, name="account")
accounts.account.command("identity")(identity.identity)
app.add_typer(accounts.token, name="token")
app.command("up")(service.up)
app.command("verify")(dossiers.verify)
app.command("evaluate")(evaluate.evaluate)
app.command("doctor")(service.doctor)


def main() -> None:
    """Entry point. A typed error becomes one sentence on standard error and an exit code."""
    try:
        app()
    except HarnessError as error:
        sys.exit(complain(error))


if __name__ == "__main__":
    main()
