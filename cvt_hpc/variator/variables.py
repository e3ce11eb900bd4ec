"""Variables that records of all models of a variator have in common."""

import numpy as np

from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import PULLEYS, STRANDS

COORDINATES = {
    "strand": Coordinate(np.array(STRANDS), "", "strand", "t1 leaves the driving pulley, t2 enters it"),
    "pulley": Coordinate(np.array(PULLEYS), "", "pulley"),
}

_SHARED = (
    Variable(
        "spectrum",
        "m",
        "at the strongest probe",
        dims=("strand", "frequency_bin"),
        words="amplitude spectrum",
    ),
    Variable("mean_ring_tension", "N", "mean ring tension in the middle of the strand", dims=("strand",)),
    Variable("mean_push_force", "N", "mean push force in the middle of the strand", dims=("strand",)),
    Variable("axial_force", "N", "mean axial force of the belt on a sheave", dims=("pulley",)),
    Variable(
        "slip", "1", "mean tangential sliding over belt speed, weighted by contact force", dims=("pulley",)
    ),
    Variable("flank_loss", "W", "mean friction power of the flanks", dims=("pulley",)),
    Variable("thrust_ratio", "1", "mean axial force of the driving over that of the driven pulley"),
    Variable("speed_loss", "1", "1 - ratio x driven speed / driving speed, mean"),
    Variable("driven_speed_ripple", "rad s-1", "standard deviation of the driven pulley's speed"),
    Variable("driving_power", "W", "mean power of the driving pulley"),
    Variable("load_power", "W", "mean power of the load"),
    Variable("thrust_power", "W", "mean power that the thrust takes up"),
    Variable("storing_power", "W", "mean rate of the stored energy"),
    Variable("ring_loss", "W", "mean friction power between rings and elements"),
    Variable("belt_loss", "W", "mean power of the belt's transverse damping"),
    Variable("layer_loss", "W", "mean power of the layers' longitudinal dampers"),
    Variable("seating_loss", "W", "mean elastic power lost by the mesh where contact ends"),
    Variable("loss", "W", "mean of all losses", words="total loss"),
    Variable(
        "efficiency",
        "1",
        "share of the power put in that is not lost, by the driving pulley or by a load that drives",
    ),
    Variable(
        "power_residual", "1", "power that the balance leaves open, over the larger of drive and losses"
    ),
)


def frequency_bins(parameters: Parameters) -> Coordinate:
    """Frequencies of the spectra of a transient [Hz].

    Parameters
    ----------
    parameters : mapping
        Flat parameters of the job or of a run [SI].
    """
    step = parameters["spectrum_step"]
    return Coordinate(np.arange(0.0, parameters["band_high"] + step / 2, step), "Hz", "frequency")


def shared(*names: str) -> tuple[Variable, ...]:
    """Variables of the records of all variators, by name."""
    by_name = {variable.name: variable for variable in _SHARED}
    return tuple(by_name[name] for name in names)
