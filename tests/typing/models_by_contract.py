"""Each model of the ladder beside its contract: nothing runs here, the type checker reads it."""

from cvt_hpc.models import (
    auto,
    beam_pushbelt,
    belt_drive,
    criterion,
    elastic_belt,
    linear_stability,
    moving_string,
    oscillator,
    pushbelt,
    quasi_static_belt,
    slip_limit,
    spatial_pushbelt,
    steady_variator,
    strand,
)
from cvt_hpc.models.auto import record as auto_record
from cvt_hpc.models.auto import transient as auto_transient
from cvt_hpc.models.beam_pushbelt import record as beam_pushbelt_record
from cvt_hpc.models.beam_pushbelt import transient as beam_pushbelt_transient
from cvt_hpc.models.belt_drive import record as belt_drive_record
from cvt_hpc.models.belt_drive import transient as belt_drive_transient
from cvt_hpc.models.contract import Declaration, Recorded, Transient
from cvt_hpc.models.criterion import record as criterion_record
from cvt_hpc.models.elastic_belt import record as elastic_belt_record
from cvt_hpc.models.elastic_belt import transient as elastic_belt_transient
from cvt_hpc.models.linear_stability import record as linear_stability_record
from cvt_hpc.models.moving_string import transient as moving_string_transient
from cvt_hpc.models.oscillator import record as oscillator_record
from cvt_hpc.models.oscillator import transient as oscillator_transient
from cvt_hpc.models.pushbelt import record as pushbelt_record
from cvt_hpc.models.pushbelt import transient as pushbelt_transient
from cvt_hpc.models.quasi_static_belt import record as quasi_static_belt_record
from cvt_hpc.models.quasi_static_belt import transient as quasi_static_belt_transient
from cvt_hpc.models.slip_limit import record as slip_limit_record
from cvt_hpc.models.spatial_pushbelt import record as spatial_pushbelt_record
from cvt_hpc.models.spatial_pushbelt import transient as spatial_pushbelt_transient
from cvt_hpc.models.steady_variator import record as steady_variator_record
from cvt_hpc.models.strand import record as strand_record

declared: Declaration
declared = auto
declared = beam_pushbelt
declared = belt_drive
declared = criterion
declared = elastic_belt
declared = linear_stability
declared = moving_string
declared = oscillator
declared = pushbelt
declared = quasi_static_belt
declared = slip_limit
declared = spatial_pushbelt
declared = steady_variator
declared = strand

recorded: Recorded
recorded = auto_record
recorded = beam_pushbelt_record
recorded = belt_drive_record
recorded = criterion_record
recorded = elastic_belt_record
recorded = linear_stability_record
recorded = oscillator_record
recorded = pushbelt_record
recorded = quasi_static_belt_record
recorded = slip_limit_record
recorded = spatial_pushbelt_record
recorded = steady_variator_record
recorded = strand_record

marched: Transient
marched = auto_transient
marched = beam_pushbelt_transient
marched = belt_drive_transient
marched = elastic_belt_transient
marched = moving_string_transient
marched = oscillator_transient
marched = pushbelt_transient
marched = quasi_static_belt_transient
marched = spatial_pushbelt_transient
