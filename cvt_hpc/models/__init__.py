"""The ladder of models; each knows physics and nothing above, and declares what a job may set."""

MODELS = {
    "criterion": "cvt_hpc.models.criterion",
    "elastic_belt": "cvt_hpc.models.elastic_belt",
    "oscillator": "cvt_hpc.models.oscillator",
    "moving_string": "cvt_hpc.models.moving_string",
    "strand": "cvt_hpc.models.strand",
    "quasi_static_belt": "cvt_hpc.models.quasi_static_belt",
}
