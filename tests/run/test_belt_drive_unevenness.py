"""Strands of a belt drive that roughness of the belt and run-out of a pulley shake, beside moving strings."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive.roughness import heights
from cvt_hpc.models.belt_drive.transient import Transient
from cvt_hpc.physics.nearest_on_path import along

# A belt that hardly bends is a string; damping by the mass lets what the start leaves die out by a second
WAVES, ROUGHNESS, RUN_OUT, PHASE, DAMPING = 40, 5e-6, 20e-6, 0.8, 40.0
SHAKEN = {
    "tension": 411.0,
    "load": 0.0,
    "elements": 192,
    "bending_stiffness": 0.002,
    "mass_damping": DAMPING,
    "roughness": ROUGHNESS,
    "roughness_waves": WAVES,
    "roughness_decay": 0.0,
    "run_out": [RUN_OUT, 0.0],
    "run_out_phase": [PHASE, 0.0],
    "strand_probes": 3,
    "duration": 1.0,
    "longest_duration": 1.0,
}


def job(**values):
    return build_job({"name": "x", "model": "belt_drive"}, "x", SHAKEN | values)


@pytest.fixture(scope="module")
def shaken():
    run = Transient(job().point(0), "cyclic_alpha")
    assert run.advance(run.samples) is None
    return run


def moving_string(run, strand, omega, first, last):
    """Middle of a moving string, y e^(-i omega t), whose ends move by `first` and `last` [m]; omega in rad/s.

    m (d/dt + c d/dx)^2 y + damping m (d/dt + c d/dx) y = T y'' has two waves e^(i k x).
    """
    m, speed, length = run.parameters["line_mass"], belt_frequency(run) * run.path.path_length, 0.45
    tension = run.channel(f"tension t{strand + 1}")[run.judged].mean()
    found = []
    for w, at_first, at_last in zip(omega, first, last, strict=True):
        k = np.roots(
            [tension - m * speed**2, m * speed * (2.0 * w + 1j * DAMPING), -m * w * (w + 1j * DAMPING)]
        )
        of_ends = np.linalg.solve([np.ones(2), np.exp(1j * k * length)], [at_first, at_last])
        found.append(of_ends @ np.exp(0.5j * k * length))
    return np.array(found)


def belt_frequency(run):
    """Revolutions of the belt per second [Hz], by where its nodes are at the end."""
    q, lengths = run._state.chain.q, run._drive.beam.lengths
    share = along(run.path, q[:, :2], q[:, 2:])[0] / run.path.path_length
    share -= (np.cumsum(lengths) - lengths) / lengths.sum()
    turned = np.angle(np.exp(2j * np.pi * share).mean()) / (2.0 * np.pi)
    return (turned + round(62.8 * 0.05 * run.time / run.path.path_length - turned)) / run.time


@pytest.fixture(scope="module")
def lines(shaken):
    """Lines of the middle of both strands in the judged part, and those of strings, (line, strand) [m]; run-out last."""
    run, wave = shaken, np.arange(1, WAVES + 1)
    omega = 2.0 * np.pi * np.append(belt_frequency(run) * wave, 62.8 / (2.0 * np.pi))
    time = (np.arange(run.samples) + 1)[run.judged] * run.interval
    middle = run.displacement[run.judged].reshape(len(time), 2, 3)[:, :, 1]
    terms = np.hstack([np.exp(-1j * np.outer(time, omega)), np.ones((len(time), 1))])
    terms = np.hstack([terms.real, -terms.imag])
    fitted = np.linalg.lstsq(terms, middle, rcond=None)[0]
    found = fitted[: len(omega)] + 1j * fitted[len(omega) + 1 : -1]
    phase = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, WAVES)
    expected = []
    for strand, start in enumerate(run.path.ends[::2]):
        ends = []
        for position, on_driving in ((start, strand == 0), (start + 0.45, strand == 1)):
            rough = np.exp(1j * (2.0 * np.pi * wave * position / run.path.path_length + phase))
            outward = run.path.leaving[strand] - 0.5 * np.pi
            eccentric = RUN_OUT * np.exp(1j * (outward - PHASE)) if on_driving else 0.0
            ends.append(np.append(ROUGHNESS * np.sqrt(2.0 / WAVES) * rough, eccentric))
        expected.append(moving_string(run, strand, omega, *ends))
    return found, np.array(expected).T


def test_heights_of_a_belt_have_their_root_mean_square_and_their_decay():
    p = job(roughness_decay=1.5).point(0) | {"contact_points": 4}
    found = heights(p, np.full(100, 0.01))
    assert found.shape == (100, 4)
    assert found.std() == pytest.approx(ROUGHNESS, rel=1e-9) and abs(found.mean()) < 1e-9 * ROUGHNESS
    size = abs(np.fft.rfft(found.ravel()))
    wave = np.arange(1, WAVES + 1)
    np.testing.assert_allclose(size[wave] / size[1], wave**-1.5, rtol=1e-9)
    assert size[WAVES + 1 :].max() < 1e-9 * size[1]


def test_a_rough_belt_shakes_its_strands_as_strings_whose_ends_move(lines, tell):
    """By size and phase of each wave; what is left comes from the bending and the mesh."""
    found, expected = (of[:-1] for of in lines)
    assert np.linalg.norm(found - expected) < 0.08 * np.linalg.norm(expected)
    tell("error of the lines of a rough belt", np.linalg.norm(found - expected) / np.linalg.norm(expected))
    resonant = abs(expected).argmax(axis=0)  # near the first frequency, 72 Hz
    assert (abs(resonant + 1 - 28) <= 2).all()
    assert (abs(expected).max(axis=0) > 8.0 * ROUGHNESS * np.sqrt(2.0 / WAVES)).all()


def test_an_eccentric_pulley_shakes_both_strands_at_its_own_frequency(lines):
    """The tension swings with it by 1 %, and so does the bulge by bending, EI / (2 N R) off the tangent."""
    found, expected = (of[-1] for of in lines)
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.05 * RUN_OUT)
    assert (abs(expected) > 0.4 * RUN_OUT).all()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"run_out": [1e-5]}, "run_out: expected a value for each pulley, 2, found 1"),
        ({"run_out_phase": [0.1, 0.2, 0.3]}, "run_out_phase: expected a value for each pulley, 2, found 3"),
        (
            {"run_out": [0.0, 1e-3]},
            "run_out: expected at most 0.0005 m, 1% of the pulley's radius, found 0.001 m",
        ),
        ({"run_out": [0.0, -1e-5]}, "run_out, item 2: expected >= 0 m"),
        (
            {"roughness": 1e-3},
            "roughness: expected at most 0.0005 m, 1% of the smallest radius, found 0.001 m",
        ),
        ({"roughness": -1e-6}, "roughness: expected >= 0 m"),
        ({"roughness_waves": 97}, "roughness_waves: expected at most 96, of two elements each, found 97"),
    ],
)
def test_an_unevenness_that_is_none_is_refused_in_one_line(values, said):
    with pytest.raises(InputError) as error:
        job(**values).point(0)
    assert said in str(error.value) and "\n" not in str(error.value)
