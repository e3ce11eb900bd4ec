"""The path of a belt: points along it, and where points lie along it."""

import numpy as np
import pytest

from cvt_hpc.physics.geometry import driven_radius, variator
from cvt_hpc.variator.history import along, points_at, regions


@pytest.mark.parametrize("ratio", [0.4, 1.0, 1.35, 2.6])
def test_points_beside_the_path_are_found_where_they_were_put(ratio):
    a, length = 0.155, 0.6612
    path = variator(ratio, driven_radius(ratio, length, a), a)
    position = np.linspace(0.0, length, 701, endpoint=False) + 1e-5
    points, angle, curvature = points_at(path, a, position)
    offset = 1e-3 * np.sin(np.arange(position.size))
    outward = np.stack([np.sin(angle), -np.cos(angle)], 1)
    found, off = along(path, a, points + offset[:, None] * outward)
    assert found == pytest.approx(position, abs=1e-14) and off == pytest.approx(offset, abs=1e-15)
    # it is smooth: steps along it are those of its direction and curvature, to the third order
    h = 1e-5
    ahead, turned, _ = points_at(path, a, position + h)
    inside = regions(path, position) == regions(path, position + h)
    step = h * np.stack([np.cos(angle), np.sin(angle)], 1) - 0.5 * h * h * curvature[:, None] * outward
    assert (ahead - points)[inside] == pytest.approx(step[inside], abs=1e-12)
    assert np.mod(turned - angle + 0.1, 2.0 * np.pi)[inside] - 0.1 == pytest.approx(
        h * curvature[inside], abs=1e-12
    )
