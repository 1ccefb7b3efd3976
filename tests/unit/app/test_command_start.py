"""The command line starts fast: its list of commands imports none of them, and says what each of them says itself."""

import subprocess
import sys

from app.cli.main import SUMMARIES, CommandGroups

HEAVY = ("fastapi", "viser", "trimesh", "harness.bootstrap", "app.main")


def test_the_list_of_commands_imports_no_command_and_says_what_each_says_of_itself() -> None:
    groups = CommandGroups(name="regen")
    said = {name: groups.get_command(None, name).get_short_help_str(200) for name in groups.list_commands(None)}
    assert said == SUMMARIES
    script = (
        "import sys\nfrom app.cli.main import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert "Start the console and everything behind it" in shown and shown.rstrip().endswith("[]")


def test_a_command_for_a_running_console_does_not_import_the_console() -> None:
    script = "import sys, app.cli.leases\nprint('app.main' in sys.modules, 'viser' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert shown.split() == ["False", "False"]
