"""Contents of the layers under the steady flow of Bullinger et al. 2005, eqs 28-30: they settle, and lag.

What forces are left at a station beyond its share in the acceleration of the whole layer shifts material
against a drag, d xi' = N,s + f - mean; content is conserved, n' = -xi'_s. Contents at the end of the step
follow by Newton's iteration, in which the corner of the push force opens and closes cells.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt

MOST_ITERATIONS = 12
CLOSE = 1e-13  # [1]: of a content


@kernel
def settle_contents(
    belt: Belt,
    drag: np.ndarray,
    share: np.ndarray,
    fields: np.ndarray,
    eps: np.ndarray,
    along: np.ndarray,
    step: float,
) -> float:
    """Set contents at the end of a step [s], and the speeds of a steady flow that go with them.

    `drag`, (2,), is that of the material against its layer [N s/m^2], `share`, (2, N), the layers' mass at
    the stations over the layer's whole mass. Of the state's `fields`, (7, N), displacements are those at the
    end of the step; contents and speeds are set. `eps` are strains at its beginning, `along` forces on the
    layers at the stations [N] but for their stresses, (2, N) each. Returns the power that the drag takes [W].
    """
    n, taken = belt.cell.size, 0.0
    lower, middle, upper, change = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    stress, steepness, shift = np.empty(n), np.empty(n), np.empty(n)
    for layer in range(2):
        stiffness = belt.ring_stiffness if layer else belt.element_stiffness
        offset = belt.ring_offset if layer else 0.0
        content, v = fields[f.N_ELEMENT + layer], fields[f.V_ELEMENT + layer]
        old, speed, whole = content.copy(), 0.0, 0.0
        for j in range(n):
            speed += share[layer, j] * v[j] / (1.0 + eps[layer, j - 1 if j > 0 else n - 1])
            whole += along[layer, j]
        for _ in range(MOST_ITERATIONS):
            for c in range(n):
                mean = 0.5 * (fields[f.W, c] + fields[f.W, c + 1 if c < n - 1 else 0])
                length = 1.0 + belt.curvature[c] * (mean + offset)
                strain = length / content[c] - 1.0
                stress[c], steepness[c] = stiffness * strain, -stiffness * length / content[c] ** 2
                if layer == 0 and strain >= 0.0:
                    stress[c] = steepness[c] = 0.0
            for j in range(n):
                here = along[layer, j] - share[layer, j] * whole
                here += stress[j] - stress[j - 1 if j > 0 else n - 1]
                shift[j] = here / (belt.dual[j] * drag[layer])
            largest = 0.0
            for c in range(n):
                a, b = c - 1 if c > 0 else n - 1, c + 1 if c < n - 1 else 0
                scale = step / (belt.cell[c] * drag[layer])
                change[c] = old[c] - content[c] + step / belt.cell[c] * (shift[c] - shift[b])
                middle[c] = 1.0 - scale * steepness[c] * (1.0 / belt.dual[c] + 1.0 / belt.dual[b])
                lower[c], upper[c] = scale * steepness[a] / belt.dual[c], scale * steepness[b] / belt.dual[b]
            _solve_cyclic(lower, middle, upper, change)
            for c in range(n):
                content[c] += change[c]
                largest = max(largest, abs(change[c]))
            if largest < CLOSE:
                break
        for j in range(n):
            taken += belt.dual[j] * drag[layer] * shift[j] ** 2
        for j in range(n):
            c = j - 1 if j > 0 else n - 1
            mean = 0.5 * (fields[f.W, c] + fields[f.W, j])
            v[j] = speed * (1.0 + belt.curvature[c] * (mean + offset)) / content[c]
    return taken


@kernel
def _solve_cyclic(lower: np.ndarray, middle: np.ndarray, upper: np.ndarray, x: np.ndarray) -> None:
    """Solve a cyclic tridiagonal system in place of x; its columns are dominated by their diagonals."""
    n = x.size
    # the last unknown closes the ring: the others with and without it
    closing, pivot = np.zeros(n), middle[0]
    closing[0] -= lower[0]
    closing[n - 2] -= upper[n - 2]
    ahead = np.zeros(n)
    x[0] /= pivot
    closing[0] /= pivot
    for j in range(1, n - 1):
        ahead[j - 1] = upper[j - 1] / pivot
        pivot = middle[j] - lower[j] * ahead[j - 1]
        x[j] = (x[j] - lower[j] * x[j - 1]) / pivot
        closing[j] = (closing[j] - lower[j] * closing[j - 1]) / pivot
    for j in range(n - 3, -1, -1):
        x[j] -= ahead[j] * x[j + 1]
        closing[j] -= ahead[j] * closing[j + 1]
    k = n - 1
    x[k] = (x[k] - upper[k] * x[0] - lower[k] * x[k - 1]) / (
        middle[k] + upper[k] * closing[0] + lower[k] * closing[k - 1]
    )
    for j in range(n - 1):
        x[j] += closing[j] * x[k]
