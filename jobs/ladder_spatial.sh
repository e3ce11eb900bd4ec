#!/usr/bin/env bash
# Cells of both pushbelts of `cvt-hpc ladder jobs/ladder_spatial.toml --out DIR`: ladder_spatial.sh DIR TABLE.csv.
# Needs the environment of jobs/quickstart.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
labels=model
columns=(amplitude frequency mean_push_force mean_ring_tension axial_force flank_loss ring_loss loss slip_loss iterations power_residual)
source jobs/parts.sh

rows_of spatial_pushbelt "$out/spatial_pushbelt"
rows_of pushbelt "$out/pushbelt"
joined
