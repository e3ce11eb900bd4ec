#!/usr/bin/env bash
# Cells of `cvt-hpc ladder jobs/ladder_pushbelt.toml --out DIR`, belt beside pushbelts:
# pushbelt_beside_belt.sh DIR TABLE.csv.
# Needs the environment of jobs/quickstart.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
labels=model
columns=(amplitude frequency mean_push_force mean_ring_tension axial_force loss power_residual)
source jobs/parts.sh

rows_of elastic_belt "$out/elastic_belt"
rows_of "pushbelt of 216 elements at 10 us" "$out/pushbelt"
rows_of "pushbelt of 432 elements at 5 us" "$out/reference"
joined
