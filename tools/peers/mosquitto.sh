#!/usr/bin/env bash
# Eclipse Mosquitto, an MQTT broker, from the distribution's packages, unpacked and not installed: FOLDER/bin/mosquitto.
set -euo pipefail
cd "$1"
mkdir -p bin
if path=$(command -v mosquitto || ls /usr/sbin/mosquitto 2>/dev/null); then
    ln -s "$path" bin/mosquitto
else
    apt-get update -qq || true
    packages=$(apt-get install -s --no-install-recommends mosquitto | awk '/^Inst/ {print $2}')
    # shellcheck disable=SC2086
    apt-get download -o APT::Sandbox::User=root $packages
    for package in *.deb; do dpkg -x "$package" root; done
    printf '#!/bin/sh\nLD_LIBRARY_PATH=%s exec %s "$@"\n' \
        "$(find "$PWD/root" -name '*.so*' -printf '%h\n' | sort -u | paste -sd:)" "$PWD/root/usr/sbin/mosquitto" \
        >bin/mosquitto
    chmod +x bin/mosquitto
fi
(bin/mosquitto -h || true) | grep "mosquitto version"
