"""Probes and modal sensors: exact where they ought to be, blind where they ought to be."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.elastic_belt.record import MODES
from cvt_hpc.models.elastic_belt.sampling import probes, sensors
from support.marched import job

STRANDS = (1, 3)  # regions of the path


@pytest.fixture(params=[48, 160])
def grid(request):
    return mesh(job(stations=request.param, end_refinement=1.0).parameters)


def weights(grid, places):
    """The sensors' matrix, in double precision."""
    return sensors(grid, places, 50e-6, np.float64).matrix


def strand(grid, region):
    """First station, number of cells, and x / length at the stations of a strand."""
    count = grid.counts[region]
    return grid.starts[region], count, grid.along(region)[:-1] / grid.path.lengths[region]


def test_probes_divide_every_region_in_equal_parts(grid):
    places = probes(grid, 5, 3)
    labels = [place.label for place in places]
    assert labels == [
        f"{name} {share}" for name in ("t1", "t2") for share in ("1/6", "1/3", "1/2", "2/3", "5/6")
    ] + [f"{name} arc {share}" for name in ("driving", "driven") for share in ("1/4", "1/2", "3/4")]
    for region, first, count in ((1, 0, 5), (3, 5, 5), (0, 10, 3), (2, 13, 3)):
        start, length = grid.position[grid.starts[region]], grid.path.lengths[region]
        found = [place.position for place in places[first : first + count]]
        assert found == pytest.approx(start + length * np.arange(1, count + 1) / (count + 1))


def test_probes_are_exact_for_linear_displacement(grid):
    # 7 probes lie within cells, at stations, wherever; the last cell, where a line is torn, is behind all of them
    places = probes(grid, 7, 4)
    matrix = weights(grid, places)[: len(places)]
    w = 3e-4 - 2e-3 * grid.position
    expected = [3e-4 - 2e-3 * place.position for place in places]
    # sums of two products: a few round-offs of 1 mm
    assert matrix @ w == pytest.approx(expected, rel=0, abs=1e-17)


def test_a_probe_behind_the_last_station_looks_round_the_corner(grid):
    # a hundred probes on t2: the last ones lie in the cell that leads back to station 0
    places = probes(grid, 99, 1)
    last = max(places, key=lambda place: place.position)
    row = weights(grid, places)[places.index(last)]
    start, cell = grid.position[-1], grid.cell[-1]
    assert last.position > start
    share = (last.position - start) / cell
    assert (row[-1], row[0]) == pytest.approx((1 - share, share))
    assert np.count_nonzero(row) == 2


@pytest.mark.parametrize("region", STRANDS)
def test_modal_sensors_are_exact_for_sines_on_a_chord(grid, region):
    first, count, x = strand(grid, region)
    sizes = np.array([5e-6, -3e-6, 2e-6, 0.0, 7e-6])
    w = np.zeros(grid.cell.size)
    w[first : first + count] = 4e-4 - 9e-4 * x
    w[(first + count) % w.size] = 4e-4 - 9e-4
    for k, size in enumerate(sizes, start=1):
        w[first : first + count] += size * np.sin(k * np.pi * x)
    found = (weights(grid, ()) @ w).reshape(2, MODES)[STRANDS.index(region)]
    # discrete sines are orthogonal; the chord, a thousand um, is taken out up to its round-off
    assert found == pytest.approx(sizes, rel=1e-9, abs=1e-17)


def test_modal_sensors_are_blind_for_arcs_the_other_strand_and_higher_modes(grid):
    matrix = weights(grid, ()).reshape(2, MODES, -1)
    for number, region in enumerate(STRANDS):
        first, count, x = strand(grid, region)
        seen = np.flatnonzero(np.abs(matrix[number]).max(axis=0))
        assert set(seen) <= {*range(first, first + count), (first + count) % grid.cell.size}
        w = np.zeros(grid.cell.size)
        w[first : first + count] = sum(np.sin(k * np.pi * x) for k in range(MODES + 1, count))
        assert matrix[number] @ w == pytest.approx(np.zeros(MODES), abs=1e-12)
        assert matrix[1 - number] @ w == pytest.approx(np.zeros(MODES), abs=0)


def test_modal_sensors_are_exact_on_shorter_cells_at_the_ends():
    graded = mesh(job(stations=160).parameters)
    matrix = weights(graded, ()).reshape(2, MODES, -1)
    for strand_number, region in enumerate(STRANDS):
        first, count, x = strand(graded, region)
        w = np.zeros(graded.cell.size)
        amplitudes = 1e-6 * np.arange(1.0, MODES + 1.0)
        w[first : first + count] = amplitudes @ np.sin(np.pi * np.outer(np.arange(1, MODES + 1), x))
        assert matrix[strand_number] @ w == pytest.approx(amplitudes, rel=1e-9)
        w[first : first + count] = 1e-6 * np.sin((MODES + 1) * np.pi * x)  # the next mode
        assert np.abs(matrix[strand_number] @ w).max() < 0.02e-6
