"""Which element a step that is not solved is at fault with, for belts of rigid elements in linked lanes."""

from __future__ import annotations

from cvt_hpc.kernels import kernel


@kernel
def most_corrected(blocks, right, weights):
    """The element with the largest correction.

    Corrections of its speeds stand in `blocks` from field `right` on, and count with `weights`, the lengths
    that make angular velocities speeds.
    """
    corrections = blocks.data
    rows, parts = corrections.shape[0], corrections.shape[2]
    largest, element = -1.0, 0
    for part in range(parts):
        for j in range(rows):
            for r in range(len(weights)):
                size = abs(corrections[j, right + r, part]) * weights[r]
                if size > largest:
                    largest, element = size, part * rows + j
    return element


@kernel
def keep_states(elements, element, kept):
    """Keep the state of an element, and of the one behind it."""
    rows, fields, parts = elements.data.shape
    for k in range(2):
        place = (element - k) % (rows * parts)
        for field in range(fields):
            kept[k, field] = elements.data[place % rows, field, place // rows]
