"""Which element a step that is not solved is at fault with, for belts of rigid elements in linked lanes."""

from cvt_hpc.kernels import kernel
from cvt_hpc.models.pushbelt import fields as f


@kernel
def most_corrected(blocks, weights):
    """The element with the largest correction.

    Corrections of its speeds stand in the right side of `blocks`, and count with `weights`, the lengths that
    make angular velocities speeds.
    """
    corrections = blocks.data
    rows, parts, right = corrections.shape[0], corrections.shape[2], 3 * len(weights) ** 2
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


@kernel
def name_fault(changes, state, element, kept):
    """Enter the contact of an element whose force has changed most since its state was kept.

    Contacts with the next element and with the one behind count, the latter as those of that element:
    `changes(kept, k)` returns by how much forces of the element (k = 0) and of the one behind it (k = 1) have
    changed, in the order of `CONTACTS`, and 0 for those of the latter that the element has no part in.
    """
    rows, fields, parts = state.elements.data.shape
    largest, contact, behind_it = -1.0, 0, 0
    for k in range(2):
        place = (element - k) % (rows * parts)
        for field in range(fields):
            kept[k, field] = abs(state.elements.data[place % rows, field, place // rows] - kept[k, field])
        sizes = changes(kept, k)
        for entry in range(len(sizes)):
            if sizes[entry] > largest:
                largest, contact, behind_it = sizes[entry], entry, k
    state.counters[f.FAILED_ELEMENT] = (element - behind_it) % (rows * parts)
    state.counters[f.FAILED_CONTACT] = contact
