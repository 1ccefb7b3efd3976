#!/usr/bin/env bash
# vda-5050-lib (npm, MIT): the vehicle's side of VDA 5050 in JavaScript, with a virtual vehicle: FOLDER/node_modules.
set -euo pipefail
cd "$1"
npm install --silent --no-audit --no-fund --prefix . vda-5050-lib@1.4.0
node -e 'require("vda-5050-lib").VirtualAgvAdapter.name'
