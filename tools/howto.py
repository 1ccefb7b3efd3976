"""Runs every command of the how-to pages as it stands, in an empty home folder and a clean clone, and says how long.

    python -m tools.howto [PAGE ...] [--publish]

Blocks marked `sh` are run one after the other in one shell; `<!-- console: ... -->` starts a mission as a browser
without scripts would, by the form of the page. What differs from the page is listed with the result.
"""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "attach-my-robot",
    "my-own-site",
    "my-own-mission",
    "write-a-provider",
    "my-own-predicate",
    "vda5050-vehicle",
    "shadow-mode",
    "ros2-robot",
)
PEERS = {"ros2-robot": "ros2"}
"""Pages that need a foreign program, and its name below .peers: where it is not installed the page is skipped."""
RESULT = ROOT / "docs" / "results" / "howto.json"
DEVIATIONS = (
    "the environment of this clone is linked into the new one: `make install` is not timed here, nor is tools/peers.sh",
    "what the page has a person press in the console is sent as the same form over HTTP",
)
STEP = re.compile(
    r"^```sh\n(?P<sh>.*?)^```$|<!-- console: port (?P<port>\d+), start (?P<template>[\w-]+) on (?P<robot>[\w-]+)"
    r" with (?P<name>\w+) (?P<value>\w+) -->",
    re.MULTILINE | re.DOTALL,
)
LONGEST_S = 600.0
END = "--- the block is over: "


def steps(page: Path) -> list[dict[str, str]]:
    """The shell blocks and console steps of a page, in order."""
    found = STEP.finditer(page.read_text(encoding="utf-8"))
    return [{name: text for name, text in one.groupdict().items() if text} for one in found]


class BashSession:
    """One bash for a whole page; every block ends at its first command that fails."""

    def __init__(self, folder: Path, home: Path) -> None:
        self._output = (home / "output").open("w+")
        environment = {"HOME": str(home), "PATH": "/usr/local/bin:/usr/bin:/bin", "LANG": "C.UTF-8"}
        self._process = subprocess.Popen(
            ["bash"],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            text=True,
            process_group=0,
        )

    def run(self, block: str) -> tuple[int, str]:
        """Exit code of the first command that failed, and what was printed."""
        assert self._process.stdin is not None
        begin = len(self.printed())
        # no subshell: `export` and `&` must last; -e is off between blocks so that the shell lives on
        quoted = shlex.quote(f"set -e\n{block}")
        self._process.stdin.write(f"eval {quoted}\nstatus=$?; set +e; echo '{END}'$status\n")
        self._process.stdin.flush()
        until_s = time.monotonic() + LONGEST_S
        while time.monotonic() < until_s and self._process.poll() is None:
            printed = self.printed()[begin:]
            if END in printed:
                text, _, code = printed.partition(END)
                return int(code.split()[0] or 1), text
            time.sleep(0.1)
        return self._process.poll() or 1, self.printed()[begin:]

    def printed(self) -> str:
        """Everything that the page's commands printed so far."""
        self._output.flush()
        return Path(self._output.name).read_text(encoding="utf-8", errors="replace")

    def close(self) -> None:
        """End the shell and what it left running."""
        os.killpg(self._process.pid, signal.SIGTERM)
        self._process.wait(20)
        self._output.close()


def from_console(step: dict[str, str], printed: str) -> tuple[int, str]:
    """Sign in by the printed link and send the form of `Start a mission`; then wait for the mission's end."""
    base = f"http://127.0.0.1:{step['port']}"
    link = re.search(rf"{base}/\S+", printed)
    if link is None:
        return 1, "no sign-in link was printed"
    with httpx.Client(base_url=base, follow_redirects=True, timeout=60.0, headers={"Origin": base}) as browser:
        browser.get(link.group())
        page = browser.get("/missions/new", params={"robot_id": step["robot"], "template": step["template"]}).text
        fields = dict(re.findall(r'<input type="hidden" name="([\w-]+)" value="([^"]*)"', page))
        typed = fields | {"robot_id": step["robot"], "template": step["template"], step["name"]: step["value"]}
        typed["goal"] = f"Go to {step['value']}"
        answer = browser.post("/missions", data=typed)
        mission = answer.url.path.rpartition("/")[2]
        if not mission.startswith("msn_"):
            return 1, f"{answer.status_code} {answer.text[:2000]}"
        until_s = time.monotonic() + LONGEST_S
        outcome: dict[str, Any] = {}
        while time.monotonic() < until_s:
            outcome = browser.get(f"/api/v1/missions/{mission}").json()
            if outcome["status"] in ("succeeded", "partly_verified", "failed", "cancelled", "awaiting_human"):
                break
            time.sleep(0.5)
    ok = (outcome.get("status"), outcome.get("goal_verdict")) == ("succeeded", "satisfied")
    return 0 if ok else 1, f"{mission} {outcome.get('status')}, goal {outcome.get('goal_verdict')}"


def followed(name: str) -> dict[str, Any]:
    """One page in a clone and a home folder of its own."""
    with TemporaryDirectory(prefix="regen-howto-") as folder:
        home, clone = Path(folder) / "home", Path(folder) / "harness"
        home.mkdir()
        subprocess.run(["git", "clone", "-q", "--depth", "1", f"file://{ROOT}", str(clone)], check=True)
        for linked in (".venv", ".peers"):
            if (ROOT / linked).exists():
                (clone / linked).symlink_to((ROOT / linked).resolve())
        shell, rows = BashSession(clone, home), list[dict[str, Any]]()
        shell.run(f"export PYTHONPATH={shlex.quote(str(clone))}")
        try:
            for step in steps(ROOT / "docs" / "how-to" / f"{name}.md"):
                begun_s = time.monotonic()
                code, text = shell.run(step["sh"]) if "sh" in step else _patiently(step, shell)
                title = step.get("sh", f"console: start {step.get('template')}").strip()
                row = {"step": title.splitlines()[0], "seconds": round(time.monotonic() - begun_s, 1), "exit": code}
                rows.append(row)
                sys.stderr.write(f"{row['exit']}  {row['seconds']:7.1f} s  {name}: {row['step']}\n")
                if code:
                    sys.stderr.write(f"{text[-4000:]}\n")
                    break
        finally:
            shell.close()
    return {"page": name, "ok": all(not row["exit"] for row in rows), "steps": rows}


def _patiently(step: dict[str, str], shell: BashSession) -> tuple[int, str]:
    """The console prints its link once it is up."""
    until_s = time.monotonic() + LONGEST_S
    while f"http://127.0.0.1:{step['port']}/" not in shell.printed() and time.monotonic() < until_s:
        time.sleep(0.5)
    return from_console(step, shell.printed())


def main(words: list[str]) -> int:
    """Exit 0 if every step of every page did what the page says."""
    names = [word for word in words if not word.startswith("--")] or list(PAGES)
    skipped = [name for name in names if name in PEERS and not (ROOT / ".peers" / PEERS[name] / "installed").exists()]
    for name in skipped:
        sys.stderr.write(f"SKIPPED {name}: {PEERS[name]} is not installed (tools/peers.sh)\n")
    results = [followed(name) for name in names if name not in skipped]
    total_s = sum(row["seconds"] for one in results for row in one["steps"])
    answer = {"deviations": DEVIATIONS, "seconds": round(total_s, 1), "skipped": skipped, "pages": results}
    text = json.dumps(answer, indent=2) + "\n"
    sys.stdout.write(text)
    if "--publish" in words:
        RESULT.write_text(text, encoding="utf-8")
    return 0 if all(one["ok"] for one in results) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
