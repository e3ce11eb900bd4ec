"""The colours of all pictures, to people who see no red or no green, and in grey."""

from itertools import combinations

import numpy as np
import pytest

from cvt_hpc.analysis import cells, figures, on_variator, value_maps, waterfall
from support.eyes import EYES, lightness, seen

STEPS = np.linspace(0.0, 1.0, 24)
ONE_WAY = {
    "amplitude": cells.AMPLITUDE_COLOURS,
    "frequency": cells.FREQUENCY_COLOURS,
    "quantity": value_maps.COLOURS,
    "spectrum": waterfall.COLOURS,
    "along the belt": on_variator.ONE_SIGN,
}
TWO_WAYS = {"quantity": value_maps.TWO_SIGNS, "along the belt": on_variator.TWO_SIGNS}
APART = 10.0  # four steps that are just noticed
MOST_METHODS = 4  # compared in one picture by colour; their lines and marks differ besides


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("name", ONE_WAY)
def test_colours_of_a_scale_get_darker_step_by_step(name, eyes):
    light = lightness(ONE_WAY[name](STEPS)[:, :3], eyes)
    assert (np.diff(light) < -0.8).all() and light[0] - light[-1] > 50.0


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("name", TWO_WAYS)
def test_colours_of_both_signs_get_darker_from_zero_on_and_differ(name, eyes):
    colours = TWO_WAYS[name](STEPS)[:, :3]
    light = lightness(colours, eyes)
    assert (np.diff(light[12:]) < 0.0).all() and (np.diff(light[:12]) > 0.0).all()
    low, high = seen(colours, eyes)[:9], seen(colours, eyes)[:14:-1]  # as far from zero
    assert np.linalg.norm(low - high, axis=-1).min() > APART


@pytest.mark.parametrize("eyes", EYES)
def test_classes_of_maps_differ_in_colour_or_in_hatching(eyes):
    for (a, one), (b, other) in combinations(cells.ALL_STYLES.items(), 2):
        apart = np.linalg.norm(np.subtract(*seen([one.fill, other.fill], eyes)))
        assert apart > APART or one.hatch != other.hatch or one.mark != other.mark, (a, b)
        in_grey = abs(np.subtract(*lightness([one.fill, other.fill])))
        assert in_grey > APART or one.hatch != other.hatch or one.mark != other.mark, (a, b)


@pytest.mark.parametrize("eyes", EYES)
def test_colours_of_lines_differ(eyes):
    looks = seen(figures.COLOURS[:MOST_METHODS], eyes)
    for one, other in combinations(looks, 2):
        assert np.linalg.norm(one - other) > APART
