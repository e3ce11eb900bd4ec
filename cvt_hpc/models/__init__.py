"""The ladder of models; each knows physics and nothing above, and declares its parameters in a job."""

MODELS = {
    "auto": "cvt_hpc.models.auto",
    "beam_pushbelt": "cvt_hpc.models.beam_pushbelt",
    "belt_drive": "cvt_hpc.models.belt_drive",
    "criterion": "cvt_hpc.models.criterion",
    "elastic_belt": "cvt_hpc.models.elastic_belt",
    "linear_stability": "cvt_hpc.models.linear_stability",
    "oscillator": "cvt_hpc.models.oscillator",
    "moving_string": "cvt_hpc.models.moving_string",
    "strand": "cvt_hpc.models.strand",
    "pushbelt": "cvt_hpc.models.pushbelt",
    "quasi_static_belt": "cvt_hpc.models.quasi_static_belt",
    "slip_limit": "cvt_hpc.models.slip_limit",
    "spatial_pushbelt": "cvt_hpc.models.spatial_pushbelt",
    "steady_variator": "cvt_hpc.models.steady_variator",
}
