"""Runs of the elastic belt that can advance together, and the cost of a batch of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.elastic_belt import OWN_STEPPERS
from cvt_hpc.models.elastic_belt.belt_settings import elements_tilt
from cvt_hpc.models.elastic_belt.deflection_settings import MODE_KEYS, RITZ
from cvt_hpc.models.elastic_belt.pulley_settings import are_free
from cvt_hpc.models.elastic_belt.step_choice import MESH
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.friction_laws import TABLE_PARAMETERS
from cvt_hpc.variator.course import profile_table
from cvt_hpc.variator.scene import measures, rounded

# Core-seconds per station and time step of a batch, measured on one core of an EPYC (Zen 5) at 160 stations.
STEP_COST = {"imex": 1.3e-7, "explicit": 6.2e-8}
# Share of that which a run takes whose stations fill all lanes; in fewer parts it takes up to the whole.
ALONE_SHARE = {"imex": 0.3, "explicit": 0.6}

_COST_PER_LAYER = 0.3  # of a ring layer, beside the rings as one

_FADED = 0.1  # [N s/m], of the default scene
LANES = {"double": 8, "single": 16}  # capacity of registers of 64 bytes
# Values that the runs of a batch have in common: the mesh, the law's kind, and the course of time.
_COURSE = ("rise_time", "start_damping", "load_history", "speed_history", "duration")
_RECORDING = ("judged_fraction", "sampling_rate", "strand_probes", "arc_probes")
_KINDS = ("friction_law", "sheave_deformation", "ring_layers", "curvature_terms", "column_bending")
_STEP = ("step", "precision", "lanes")
SHARED = (*MESH, *TABLE_PARAMETERS, *_COURSE, *_RECORDING, *_KINDS, *_STEP, *MODE_KEYS, *RITZ)


def cost(p: Parameters, stepper: str, step_cost: Mapping[str, float] = STEP_COST) -> Any:
    """Core-seconds of a batch; of general steppers, some of which choose their step, little is known.

    Resolved parameters of a run are numbers or arrays of them; `step_cost` is per station and time step, by
    stepper.
    """
    is_alone = np.equal(p.get("lanes", "runs"), "stations")
    share = np.where(is_alone, ALONE_SHARE.get(stepper, 1.0), 1.0)[()]
    layers = np.asarray(p.get("ring_layers", 1))
    share = share * np.where(layers > 1, 1.0 + _COST_PER_LAYER * layers, 1.0)[()]
    return share * step_cost.get(stepper, 1e-5) * p["stations"] * p["duration"] / p.get("step", 1e-6)


def lanes(parameters: Parameters, stepper: str) -> int:
    """Most runs that a batch can take, by parameters of one and the stepper's name; general ones take one."""
    if stepper not in OWN_STEPPERS or parameters["lanes"] == "stations":
        return 1
    return LANES[parameters["precision"]]


def faded_coupling(parameters: Parameters) -> float:
    """Coupling of stations by an implicit step [N s/m] below which it counts for nothing.

    Others are 1e4 times as large, and more.
    """
    size = measures(parameters)
    return _FADED * rounded(size.force * size.time / size.length)


def lane_key(parameters: Parameters) -> tuple:
    """Values that two runs must have in common to be in one batch."""
    alike = (parameters[key] for key in SHARED if key in parameters)
    common = parameters["friction_memory"] > 0.0, are_free(parameters), faded_coupling(parameters)
    course = profile_table(parameters).tobytes()
    return (*alike, *common, elements_tilt(parameters), course)
