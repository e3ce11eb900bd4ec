#!/usr/bin/env bash
# Curvature terms and rocking elements over the loads of jobs/belt_terms.toml, in three scenes: jobs/results/belt_terms.csv.
# Needs the environment of jobs/quickstart.sh; out/belt_terms_* keep what is done. Values are assumptions, see the job.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
job=belt_terms
labels=scene,switch
columns=(amplitude frequency mean_push_force mean_ring_tension axial_force power_residual time_step)
source jobs/parts.sh

# the scene at ratio 1 of jobs/chart_ratios.toml, with loads around its own
ratio_1=(--set 'belt_length=661.2 mm' --set 'ratio=1.063' --set 'driving_speed=1475 rpm' --set 'thrust=67.72 kN'
  --set 'friction_gradient=-1.178 s/m' --set 'friction_memory=0.1447 ms' --set stiffness_of=sheave
  --set sheave_stiffness=1.772 --set 'element_mass=1.241 kg/m' --set 'ring_mass=0.2921 kg/m'
  --set 'load={ from = "530 N m", to = "650 N m", step = "20 N m" }')
# the scene in overdrive of jobs/chart_ratios.toml, between rigid sheaves, with loads around its own
overdrive=(--set 'belt_length=661.2 mm' --set 'centre_distance=155 mm' --set 'ratio=0.5249' --set 'driving_speed=4900 rpm'
  --set 'thrust=62.99 kN' --set friction_law=linear --set 'friction_gradient=-0.3008 s/m' --set 'friction_memory=0.1394 ms'
  --set stiffness_of=sheave --set sheave_stiffness=inf --set 'element_mass=1.257 kg/m' --set 'ring_mass=0.231 kg/m'
  --set 'load={ from = "60 N m", to = "180 N m", step = "20 N m" }')

switches() { # SCENE SETTINGS...
  local scene=$1 rocking=(--set column_bending=rocking)
  shift
  part "$scene,none" "$@"
  part "$scene,path" "$@" --set curvature_terms=path
  part "$scene,straight" "$@" --set curvature_terms=straight
  part "$scene,limp" "$@" --set 'bending_stiffness=0.05 N m^2'
  part "$scene,limp_straight" "$@" --set 'bending_stiffness=0.05 N m^2' --set curvature_terms=straight
  part "$scene,rocking" "$@" "${rocking[@]}"
  part "$scene,rocking_on_narrow_faces" "$@" "${rocking[@]}" --set 'outer_edge=0.1 mm' --set 'inner_edge=0.1 mm'
  part "$scene,rocking_5" "$@" "${rocking[@]}" --set 'column_stiffness=5 N m^2' --set 'outer_edge=3 mm'
  # solid faces of 3 mm: EA h^2 / 12
  part "$scene,rocking_30" "$@" "${rocking[@]}" --set 'column_stiffness=30 N m^2' --set 'outer_edge=3 mm'
  part "$scene,rocking_30_about_pitch_line" "$@" "${rocking[@]}" --set 'column_stiffness=30 N m^2' \
    --set 'outer_edge=1.5 mm' --set 'inner_edge=1.5 mm'
}

switches low
part low,path_and_rocking --set column_bending=rocking --set curvature_terms=path
switches ratio_1 "${ratio_1[@]}"
switches overdrive "${overdrive[@]}"
joined
