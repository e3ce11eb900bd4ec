"""One run: a model marched by a stepper, or solved at once, judged, and turned into a record or a history."""

from cvt_hpc.simulation.record import declared_record as declared_record
from cvt_hpc.simulation.record import estimate_cost as estimate_cost
from cvt_hpc.simulation.record import forget as forget
from cvt_hpc.simulation.record import lane_groups as lane_groups
from cvt_hpc.simulation.record import may_join as may_join
from cvt_hpc.simulation.record import pilot_share as pilot_share
from cvt_hpc.simulation.record import profile_bytes as profile_bytes
from cvt_hpc.simulation.record import record_coordinates as record_coordinates
from cvt_hpc.simulation.record import record_variables as record_variables
from cvt_hpc.simulation.record import run_costs as run_costs
from cvt_hpc.simulation.record import turns as turns
from cvt_hpc.simulation.running import Interrupted as Interrupted
from cvt_hpc.simulation.running import alone as alone
from cvt_hpc.simulation.running import run_point as run_point
from cvt_hpc.simulation.running import run_points as run_points
from cvt_hpc.simulation.running import run_points_keeping as run_points_keeping
from cvt_hpc.simulation.running import simulate as simulate
