#!/usr/bin/env bash
# Installs the foreign programs that tests/peers talks to: runs every tools/peers/*.sh with its folder .peers/NAME.
# One that cannot be installed is said and left out: its tests are skipped, and counted as skipped.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p .peers
missing=()
for script in tools/peers/*.sh; do
    name=$(basename "$script" .sh)
    folder=$PWD/.peers/$name
    if [ -f "$folder/installed" ] && cmp -s "$script" "$folder/installed"; then
        echo "peer $name: installed"
        continue
    fi
    rm -rf "$folder" && mkdir -p "$folder"
    echo "peer $name: installing (log: .peers/$name.log)"
    if bash "$script" "$folder" >".peers/$name.log" 2>&1; then
        cp "$script" "$folder/installed"
    else
        missing+=("$name")
        tail -n 3 ".peers/$name.log" | sed 's/^/    /'
    fi
done
if [ ${#missing[@]} -gt 0 ]; then
    echo "NOT installed: ${missing[*]}. Their tests will be skipped."
fi
