#!/usr/bin/env bash
# Brings .venv to exactly what a lock names, then installs the project itself. Does nothing when it is there already.
# Usage: tools/install.sh requirements.lock | requirements-test.lock   (PYTHON=... chooses the interpreter)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
lock=$1
log=.venv/install.log
at_once=4 # pips that share the lock between them: one waits for the index while another unpacks

new_enough='import sys; raise SystemExit(sys.version_info < (3, 11))'

find_python() {
    local candidate candidates=${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}
    for candidate in $candidates; do
        if "$candidate" -c "$new_enough" 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    echo "RegenHarness needs Python 3.11 or newer; none of these is one: $candidates." >&2
    echo "Install one (Debian: apt-get install python3 python3-venv) or name it: make PYTHON=/path/to/python3.12 ..." >&2
    exit 1
}

create_environment() {
    local python
    python=$(find_python)
    echo "Creating .venv with $("$python" --version)"
    rm -rf .venv
    "$python" -m venv .venv >/dev/null 2>&1 && return
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then # Debian keeps venv in a package of its own
        echo "This Python has no venv module: installing Debian's python3-venv"
        { apt-get update -qq && apt-get install -y -qq --no-install-recommends python3-venv; } </dev/null >/dev/null
        rm -rf .venv
        "$python" -m venv .venv && return
    fi
    echo "Cannot create .venv: this Python has no working venv module (Debian: apt-get install python3-venv)." >&2
    exit 1
}

show_progress() { # one line per package on a terminal's single line; every tenth elsewhere
    local total=$1 seen=0 line name
    while IFS= read -r line; do
        echo "$line" >>"$log"
        case $line in
            "Collecting "* | "Processing "* | "Ignoring "* | "Requirement already satisfied: "*) seen=$((seen + 1)) ;;
            *) continue ;;
        esac
        name=${line#Collecting }
        name=${name#Ignoring }
        name=${name#Processing }
        name=${name##*/}
        name=${name#Requirement already satisfied: }
        if [ "$seen" = "$total" ]; then
            printf '%s  unpacking (the longest step)' "$([ -t 1 ] && printf '\r\033[K')"
        elif [ -t 1 ]; then
            printf '\r\033[K  %d/%d %s' "$seen" "$total" "${name%%[=;<> ]*}"
        elif [ $((seen % 10)) = 0 ]; then
            printf '  %d/%d' "$seen" "$total"
        fi
    done
    echo
}

pip_install() {
    .venv/bin/python -m pip install --disable-pip-version-check --no-input --progress-bar off "$@" </dev/null
}

# The lock names everything, so no pip has to ask what else is needed. Modules are compiled when they are first imported:
# that is one in three of them, on all cores, and not before the first page.
install_lock() {
    local part pips=() failed=0 parts=.venv/parts
    rm -rf "$parts"
    mkdir "$parts"
    awk -v parts="$parts" -v count="$at_once" \
        '/^[A-Za-z0-9]/ { part = number++ % count } number { print > (parts "/" part) }' "$1"
    for part in "$parts"/*; do
        pip_install --require-hashes --no-deps --no-compile -r "$part" &
        pips+=($!)
    done
    for part in "${pips[@]}"; do wait "$part" || failed=1; done
    rm -rf "$parts"
    return "$failed"
}

stamp_of() { # what .venv holds once this lock is installed
    echo "$(.venv/bin/python --version) $(cat "$1" pyproject.toml tools/install.sh | sha256sum | cut -d' ' -f1)"
}

is_installed() {
    [ -f ".venv/installed-$1" ] && [ "$(cat ".venv/installed-$1")" = "$(stamp_of "$1")" ]
}

.venv/bin/python -c "$new_enough" 2>/dev/null || create_environment
if is_installed "$lock" || is_installed requirements-test.lock; then # the test lock contains the other one
    exit 0
fi

packages=$(grep -cE '^[A-Za-z0-9]' "$lock")
started=$SECONDS
echo "Installing $packages locked packages into .venv"
: >"$log"
rm -f .venv/installed-*
if ! install_lock "$lock" 2>>"$log" | show_progress "$packages"; then
    tail -n 25 "$log" >&2
    echo "Installing failed; the whole log is in $log. Check the network or the package index, then run it again." >&2
    exit 1
fi
if ! pip_install --quiet --no-deps --no-build-isolation -e . >>"$log" 2>&1; then
    tail -n 25 "$log" >&2
    exit 1
fi
stamp_of "$lock" >".venv/installed-$lock"
echo "Installed in $((SECONDS - started)) s"
