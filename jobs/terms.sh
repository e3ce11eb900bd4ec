#!/usr/bin/env bash
# What each term of the continuous belt changes, term by term: jobs/results/terms.csv.
# Needs the environment of jobs/quickstart.sh; out/terms_* keep what is done. Values are assumptions, see the job.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
job=terms
labels=switch
columns=(amplitude frequency tilt_loss power_residual time_step)
source jobs/parts.sh

part none
part bedding --set 'local_length=3 mm'
part limp --set 'bending_stiffness=0.02 N m^2'
part tilt --set 'tilt_spring=3267 N'
part column --set column_bending=rocking --set 'column_stiffness=5 N m^2' \
  --set 'outer_edge=3 mm'
part long_rings --set 'reference_tension=770 N'
part layers --set 'element_damping=2 N s' --set 'ring_damping=0.4 N s'
part path --set curvature_terms=path
part rigid_discs --set sheave_stiffness=inf
part memory --set 'friction_memory=0.1 ms'
part tilt_lag --set 'tilt_lag=0 s'
joined
