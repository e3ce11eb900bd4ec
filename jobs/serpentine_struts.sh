#!/usr/bin/env bash
# The serpentine drive with struts, springs and dashpots that pull at the arms, at 45 N m: jobs/results/serpentine_struts.csv.
# Needs the environment of jobs/quickstart.sh; out/serpentine_* keep what is done. Values are ASSUMPTIONS: the paper's sketch has
# V1 and V2, spring and dashpot side by side, without measures. Here they hold the axes of P2 and P4, across the arms, and are as
# stiff, and brake as much, as the springs and dashpots of jobs/serpentine.toml that turn with the arms.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
job=serpentine
labels=part
columns=(speed_loss strand_tension tension_ripple arm_angle arm_ripple power_residual)
source jobs/parts.sh

at=(--set 'load=45 N m')
struts=("${at[@]}" --set 'tensioner_stiffness=[0, 0]' --set 'tensioner_damping=[0, 0]'
  --set 'strut_held_x=[0.25, 0.396]' --set 'strut_held_y=[-0.035, 0.264]'
  --set 'strut_fixed_x=[0.315, 0.47]' --set 'strut_fixed_y=[-0.125, 0.328]'
  --set 'strut_stiffness=[6490, 8345]') # [N/m]: 80 N m/rad on arms of 111 and 98 mm
part springs "${at[@]}"
part struts "${struts[@]}" --set 'strut_damping=[81.1, 104.3]'
part struts_without_dashpots "${struts[@]}" --set 'strut_damping=[0, 0]'
part struts_of_tenfold_damping "${struts[@]}" --set 'strut_damping=[811, 1043]'
joined
