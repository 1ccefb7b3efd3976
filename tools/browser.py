"""Finds a Chromium that works, or installs one: Debian's headless shell, else the system's, else Playwright's download.

The headless shell has no browser window around its pages: opening a page takes a sixth of the processor time.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Playwright, sync_playwright

SHELL = "chromium-headless-shell"
SYSTEM_NAMES = (SHELL, "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
FLAGS_2D = (*FLAGS, "--disable-gpu", "--disable-software-rasterizer")
"""Pages without 3D: half of the processor time."""
FLAGS_3D = (*FLAGS, "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""WebGL, drawn by the processor."""


def find(playwright: Playwright) -> Path | None:
    """The first browser that answers `--version`: REGEN_CHROMIUM, the system's, then Playwright's."""
    named = os.environ.get("REGEN_CHROMIUM")
    system = [shutil.which(name) for name in SYSTEM_NAMES]
    for candidate in (named, *system, playwright.chromium.executable_path):
        if candidate and _answers(candidate):
            return Path(candidate)
    return None


def ensure(playwright: Playwright) -> Path:
    """A working browser, the headless shell where Debian has it; raises SystemExit with instructions if none works."""
    privileged = os.geteuid() == 0 and shutil.which("apt-get") is not None
    if privileged and not os.environ.get("REGEN_CHROMIUM") and shutil.which(SHELL) is None:
        print("Installing Debian's headless Chromium", flush=True)
        _run("apt-get", "update", "-qq")
        _run("apt-get", "install", "-y", "-qq", "--no-install-recommends", SHELL)
    found = find(playwright)
    if not found:
        print("No Chromium found: downloading Playwright's own", flush=True)
        with_packages = ("--with-deps",) if privileged else ()
        _run(sys.executable, "-m", "playwright", "install", *with_packages, "chromium")
        found = find(playwright)
    if not found:
        raise SystemExit("No Chromium works here. Install one, or name it: REGEN_CHROMIUM=/path/to/chromium make test")
    return found


def _answers(executable: str) -> bool:
    try:
        answer = subprocess.run([executable, "--version"], capture_output=True, text=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return answer.returncode == 0 and any(name in answer.stdout for name in ("Chromium", "Chrome"))


def _run(*command: str) -> None:
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, env=quiet, check=False)
    if ended.returncode:
        print(ended.stdout[-1500:], ended.stderr[-1500:], sep="\n", file=sys.stderr)


if __name__ == "__main__":
    with sync_playwright() as driver:
        ensure(driver)
