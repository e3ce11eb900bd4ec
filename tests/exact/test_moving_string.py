"""The moving string's closed form against published numbers and its equations, and the mesh against both."""

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.models.moving_string.exact import exact, frequency, travelling
from cvt_hpc.models.moving_string.transient import initial_state, moving_string, system
from support.small_systems import finished, order, scene

UNIT = scene("moving_string", length=1.0, tension=1.0, line_mass=1.0)


@pytest.mark.parametrize(
    ("speed", "mode", "expected"),
    [(0.3, 1, 2.858849), (0.3, 2, 5.717699), (0.6, 1, 2.010619), (0.9, 1, 0.596903)],
)
def test_eigenfrequencies(speed, mode, expected):
    assert 2 * np.pi * frequency(UNIT | {"belt_speed": speed}, mode) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("shape", ["mode", "pulse"])
def test_travelling_waves_satisfy_the_equation(shape):
    c, v = 1.0, 0.4
    p = UNIT | {"belt_speed": v, "shape": shape, "mode": 3, "largest_displacement": 1.0}
    x, t, h = np.linspace(0.0, 1.0, 41), np.linspace(0.0, 5.0, 101), 1e-4
    w = {(i, j): travelling(p, x + i * h, t + j * h)[0] for i in (-1, 0, 1) for j in (-1, 0, 1)}
    tt = (w[0, 1] - 2 * w[0, 0] + w[0, -1]) / h**2
    xx = (w[1, 0] - 2 * w[0, 0] + w[-1, 0]) / h**2
    xt = (w[1, 1] - w[1, -1] - w[-1, 1] + w[-1, -1]) / (4 * h**2)
    # differences of second order: h^2 times fourth derivatives of 1e5
    assert tt + 2 * v * xt + v**2 * xx == pytest.approx(c**2 * xx, abs=1e-5 * np.abs(xx).max())
    assert np.abs(w[0, 0][[0, -1]]).max() < 1e-12
    speed = (w[0, 1] - w[0, -1]) / (2 * h)
    assert travelling(p, x, t)[1] == pytest.approx(speed, abs=1e-5 * np.abs(speed).max())
    assert np.abs(w[0, 0]).max() > 0.5


def test_the_motion_comes_back_after_the_period():
    p = UNIT | {"belt_speed": 0.4, "shape": "pulse"}
    once = 1.0 / frequency(p)
    assert exact(p, np.array([0.3 + once])) == pytest.approx(exact(p, np.array([0.3])), abs=1e-12)


def test_mesh_has_the_frequencies_that_it_states():
    p = UNIT | {"belt_speed": 0.4, "cells": 24}
    equations, string = system(p), moving_string(p)
    columns = []
    for unit in np.eye(equations.scale.size):
        out = np.zeros_like(unit)
        assert equations.rates(string, 0.0, unit, out)
        columns.append(out)
    found = np.sort(np.abs(np.linalg.eigvals(np.array(columns).T).imag))[::2]
    # a standing wave of two numbers of one frequency, half a turn apart along the string: k1 + k2 = 2 pi n
    h = string.cell
    wave = np.linspace(1e-4, np.pi / h, 200_001)
    gyroscopic = 0.4 * np.sin(wave * h) / h
    root = np.sqrt(gyroscopic**2 + (1 - 0.4**2) * (2 / h * np.sin(wave * h / 2)) ** 2)
    up, down = root - gyroscopic, root + gyroscopic
    rising = slice(0, np.argmax(up))
    for n in (1, 2, 3):
        of_sum = wave[rising] + np.interp(up[rising], down, wave)
        assert found[n - 1] == pytest.approx(np.interp(2 * np.pi * n, of_sum, up[rising]), rel=1e-6)


@pytest.mark.parametrize("shape", ["mode", "pulse"])
def test_error_of_the_mesh_is_of_second_order(shape):
    cells = np.array([24, 36, 48, 72, 96])
    errors = []
    for number in cells:
        p = scene("moving_string", shape=shape, cells=int(number), strand_probes=5, duration=0.01, step=4e-6)
        run = finished("moving_string", "runge_kutta_4", p)
        errors.append(np.abs(run.displacement - exact(p, run.times)).max())
    assert order(1.0 / cells, errors) == pytest.approx(2.0, abs=0.2)


def test_it_starts_as_it_should_and_has_an_energy():
    p = scene("moving_string", duration=0.01, step=2e-6)
    run = finished("moving_string", "runge_kutta_4", p)
    assert initial_state(p)[:63] == pytest.approx(
        travelling(p, 0.15 / 64 * np.arange(1, 64), np.zeros(1))[0][:, 0]
    )
    energy = run.channel("energy")
    # of a mode: half of m w^2 a^2 L / 2 at rest; at this speed the same but for (v / c)^2 = 2 %
    expected = 0.25 * 1.3 * 0.15 * (2 * np.pi * frequency(p) * 1e-5) ** 2
    assert energy == pytest.approx(expected, rel=0.05)
    assert np.ptp(energy) < 1e-9 * energy[0]


def test_a_string_beyond_its_critical_speed_is_refused():
    job = {"name": "x", "model": "moving_string"}
    with pytest.raises(ValueError, match=r"belt_speed: expected less than the wave speed .* = 62.0174 m/s"):
        build_job(job | {"scene": {"belt_speed": 63.0}}, "x.toml")
    with pytest.raises(ValueError, match=r"cells: expected strand_probes \+ 1 = 6 or more, found 5"):
        build_job(job | {"mesh": {"cells": 5}}, "x.toml")
