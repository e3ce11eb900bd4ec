#!/usr/bin/env bash
# The spatial pushbelt beside the planar one, aligned, at 60 N m: jobs/results/spatial_beside_planar.csv.
# Needs the environment of jobs/quickstart.sh; out/clamping_* and out/spatial_push_force_* keep what is done.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
labels=sheaves,model,loose_sheaves,flank_reach
columns=(axial_force mean_ring_tension mean_push_force flank_loss ring_loss loss power_residual)
source jobs/parts.sh

scene=(--set 'load=60 N m' --set 'thrust=20 kN' --set elements=432)
aligned=("${scene[@]}" --set 'misalignment=0 mm')
both=(--set driving_loose_side=both --set driven_loose_side=both)
# both points of a flank are one, so that nothing holds elements against roll: the belt must not be led out of its plane
one_height=(--set 'flank_reach=1e-9 m' --set 'disturbance=0 m')
rigid=(--set sheave_stiffness=inf)

job=clamping
part elastic,planar,both, "${scene[@]}"
part rigid,planar,both, "${scene[@]}" "${rigid[@]}"
job=spatial_push_force
part elastic,spatial,both,1e-09 "${aligned[@]}" "${both[@]}" "${one_height[@]}"
part elastic,spatial,both,0.003 "${aligned[@]}" "${both[@]}"
part elastic,spatial,one,0.003 "${aligned[@]}"
part rigid,spatial,both,1e-09 "${aligned[@]}" "${both[@]}" "${one_height[@]}" "${rigid[@]}"
part rigid,spatial,both,0.003 "${aligned[@]}" "${both[@]}" "${rigid[@]}"
joined
