#!/usr/bin/env bash
# Each part of the pulleys' freedom by itself, over the loads of jobs/pulleys.toml: jobs/results/pulleys.csv.
# Needs the environment of jobs/quickstart.sh; out/pulleys_* keep what is done. Values are assumptions, see the job.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
job=pulleys
labels=part
columns=(amplitude frequency axial_force sheave_tilt driving_power lag_loss speed_loss torque_ratio power_residual)
source jobs/parts.sh

# a shaft of 220 mm, 45 mm thick between the sheaves; its collar is as much stiffer as to leave the driven pulley as it was
shaft=(--set 'shaft_lengths=["30 mm", "50 mm", "60 mm", "50 mm", "30 mm"]'
  --set 'shaft_diameters=["30 mm", "40 mm", "45 mm", "40 mm", "30 mm"]'
  --set 'bearing_positions=["15 mm", "205 mm"]' --set 'seat_positions=["85 mm", "135 mm"]')
collar=(--set 'tilt_stiffness=1.26e6 N m/rad') # with the shaft 6.3e5

# a motor that holds its speed within 3 % at 50 N m
motor=(--set 'driving_inertia=0.05 kg m^2' --set 'drive_slope=5 N m s/rad')

still=(--set 'driven_spring_rate=0 N/m')
part none "${still[@]}"
part spring
part oil "${still[@]}" --set 'driving_piston=["20 mm", "90 mm"]' --set 'driven_piston=["20 mm", "70 mm"]'
part drive "${still[@]}" "${motor[@]}"
part drive_and_given_driven_speed "${still[@]}" --set 'driving_inertia=0.05 kg m^2' --set driven_inertia=inf --set 'drive_slope=0 N m s/rad'
part ratio_held "${still[@]}" --set driving_axial=ratio --set 'duration=1 s'
part clamping_held "${still[@]}" --set clamping=torque_ratio
part both_held "${still[@]}" --set driving_axial=ratio --set clamping=torque_ratio --set 'duration=1 s'
for lag in 0 0.3 1 2 5; do
  part "tilt_lag_${lag}ms" "${still[@]}" --set "tilt_lag=$lag ms"
done
part collar_clearance "${still[@]}" --set 'collar_clearance=0.5 mrad'
part collar_clearance_without_lag "${still[@]}" --set 'tilt_lag=0 s' --set 'collar_clearance=0.5 mrad'
part shaft "${still[@]}" "${shaft[@]}"
part shaft_and_collar "${still[@]}" "${shaft[@]}" "${collar[@]}"
part shaft_rigid "${still[@]}" "${shaft[@]}" --set shaft_factor=inf
part bearing_clearance "${still[@]}" "${shaft[@]}" "${collar[@]}" --set 'bearing_clearance=20 um'
joined
