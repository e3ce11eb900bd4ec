"""Falling friction without memory is ill posed: single stations are unstable by themselves, at the mesh's scale.

Seen in the eigenvalues of a settled belt, 60 N m, gradient -1.2 s/m. A step that damps such motions away does
not make them part of a sound model: runs look orderly and depend on the mesh (jobs/memory.toml).
"""

import numpy as np
import pytest

from support.belts import eigenvalues

STEEP = {"friction_gradient": -1.2, "step": 1e-7}
STRANDS = 1000.0  # [Hz]: above every frequency that the strands have here


def growing(memory, stations):
    """Growth rates [1/s] and frequencies [Hz] of what grows by more than 50 per second."""
    found = eigenvalues(friction_memory=memory, stations=stations, **STEEP)
    found = found[(found.real > 50.0) & (found.imag >= 0.0)]
    return found.real, found.imag / (2.0 * np.pi)


@pytest.mark.slow
def test_without_memory_what_grows_is_the_mesh_s():
    highest = []
    for stations in (48, 96):
        rates, frequencies = growing(0.0, stations)
        # Doubled within a third of the period of any strand's vibration. A station whose friction falls steeply
        # runs away without swinging, so that of frequencies only the highest that grows says something.
        assert rates.max() > 3.0 * np.log(2.0) * STRANDS and frequencies.max() > 3.0 * STRANDS
        highest.append(frequencies.max())
    # and the higher the finer the mesh: there is nothing to converge to
    assert highest[1] > 1.5 * highest[0]


@pytest.mark.slow
def test_with_memory_what_grows_is_a_vibration_of_strands_or_nothing():
    for stations in (48, 96):
        rates, frequencies = growing(0.3e-3, stations)
        assert np.all(frequencies < STRANDS) and np.all(rates < 1000.0)
