"""One sample of a steady state, by the kernel that records transients of the belt."""

from __future__ import annotations

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.state_march import StateMarch
from cvt_hpc.variator import PULLEYS


def sampled(belt: Belt, state: State) -> dict[str, float]:
    """The elastic belt's channels in a state."""
    march = StateMarch([belt], [state])
    march.advance(0, 1.0)
    return march.channels()


def sampled_profiles(belt: Belt, state: State) -> dict[str, np.ndarray]:
    """The elastic belt's PROFILES in a state, (N,) each."""
    march = StateMarch([belt], [state])
    march.advance(0, 1.0)
    return {name: values[:, 0] for name, values in march.profiles().items()}


def largest_slip(belt: Belt, state: State) -> float:
    """Tangential sliding over belt speed, of the pulley that slips more [1]."""
    seen = sampled(belt, state)
    return max(abs(seen[f"slip {pulley}"]) for pulley in PULLEYS)
