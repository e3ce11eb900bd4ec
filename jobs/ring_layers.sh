#!/usr/bin/env bash
# Ring layers by number, and nine of them with shorter steps and other friction and lengths: jobs/results/ring_layers.csv.
# Needs the environment of jobs/quickstart.sh; out/ring_layers_* keep what is done. Values are assumptions, see the job.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
job=ring_layers
labels=part
columns=(amplitude frequency ring_loss loss efficiency mean_ring_tension mean_push_force layer_speed layer_tension surface_loss
  surface_sliding step_ripple power_residual)
source jobs/parts.sh

nine=(--set 'ring_layers=[9]')
part number
# the stack as thick as nine layers, 1.665 mm
part stack_of_3 --set 'ring_layers=[3]' --set 'layer_thickness=0.555 mm'
part stack_of_6 --set 'ring_layers=[6]' --set 'layer_thickness=0.2775 mm'
part step_2us "${nine[@]}" --set 'step=2 us'
part oiled_layers "${nine[@]}" --set 'layer_friction=0.03'
part inner_ring_long "${nine[@]}" --set 'layer_tolerance=[1.0002, 1, 1, 1, 1, 1, 1, 1, 1]'
joined
