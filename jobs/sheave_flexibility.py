"""Flexibilities and eigenforms of a pulley's discs by finite elements: sheave_flexibility.py FOLDER

Writes FOLDER/driving.nc and FOLDER/driven.nc, which `driving_flexibility_file`, `driving_modes_file` and the
like of a job's table [deflection] take, for the radii and wraps of one speed ratio. Needs the extra `discs`:
pip install -e ".[discs]".
Options set sizes: --outer-radius "85 mm", --ratio 2.0.

A disc is a body of revolution: a conical flank, a thickness that changes linearly from hub to rim, clamped to
hub and shaft at its inner radius; what gives way there is `tilt_stiffness` and the table [shaft] of a job.
In harmonic n it moves by U(r, z) cos(n phi) radially, V sin(n phi) around and W cos(n phi) along its axis.
Each harmonic is a plane problem of its own, solved by scikit-fem with quadratic quadrilaterals: bending,
shear and the local deformation of the flank, no theory of plates. Of a unit axial force at angle 0, spread
over the height of an element's flank and acting normal to it, harmonic n has the amplitude w_n, and

    w(phi) = 2 sum_n w_n cos(n phi)

is what both discs of a groove open by. A mode with frequency f_k and modal flexibility c_k has the mass
1 / (c_k (2 pi f_k)^2); the flexibilities of a harmonic's modes add up to w_n, and what the kept ones leave of
it is written as a mode without mass. Knots of the table stand for forces that fall linearly to both
neighbours.

No paper gives sizes. Every one here is an ASSUMPTION, plausible and not measured, and so is that both discs
of a groove are alike, and that contact lies at the pitch radius.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.sparse.linalg import LinearOperator, eigsh, splu
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshQuad,
    __version__,
)
from skfem.helpers import grad

from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.job.units import to_si
from cvt_hpc.physics.geometry import cut_path, variator
from cvt_hpc.storage.files import written_aside
from cvt_hpc.storage.netcdf import attributes, write_netcdf
from cvt_hpc.storage.provenance import history_line

DISCS = 2  # of a groove, alike
QUADRATURE = 6


@dataclass(frozen=True)
class Disc:
    """Sizes of a disc [SI] and of its mesh; all are assumptions."""

    inner_radius: float = 0.022  # of the hub, on which it is clamped
    outer_radius: float = 0.080
    inner_thickness: float = 0.022
    outer_thickness: float = 0.012
    half_wedge_angle: float = float(np.deg2rad(11.0))
    flank_height: float = 0.008  # of an element: radial extent of the contact
    modulus: float = 2.1e11
    poisson_ratio: float = 0.3
    density: float = 7850.0
    cell: float = 0.002  # radial size of a finite element; across the disc there are as many of that size


@dataclass(frozen=True)
class Scene:
    """Where the belt runs, and how fine tables are; the radii are those of `jobs/lebrecht_2004.toml`."""

    ratio: float = 2.52
    driven_radius: float = 0.075
    centre_distance: float = 0.155
    stations: int = 160  # around the belt, of even cells: the knots of the tables are their ends
    least_wave: float = 0.004  # around the arc: two elements
    highest_frequency: float = 30e3  # modes above it have no mass


UNITS = {
    "half_wedge_angle": "rad",
    "modulus": "Pa",
    "poisson_ratio": "",
    "density": "kg/m^3",
    "ratio": "",
    "stations": "",
    "highest_frequency": "Hz",
}  # all else is a length


class Sectors:
    """Harmonics of one disc: stiffness and mass, and the load of a unit axial force.

    Parameters
    ----------
    disc : Disc
        Its sizes.
    radii : sequence of float
        Of contact [m]; the mesh has its borders there.
    """

    def __init__(self, disc: Disc, radii: tuple[float, ...]) -> None:
        self.disc = disc
        self.mesh = _mesh(disc, radii)
        self._element = ElementVector(ElementQuad2(), 3)
        self.basis = Basis(self.mesh, self._element, intorder=QUADRATURE)
        self.clamped = self.basis.get_dofs(lambda x: np.abs(x[0] - disc.inner_radius) < 1e-9).all()
        dofs = self.basis.nodal_dofs, self.basis.facet_dofs, self.basis.interior_dofs
        self.around = np.concatenate([kind[1::3].ravel() for kind in dofs])
        # strains are linear in n: three harmonics give the stiffness of all
        samples = [_stiffness(disc, n).assemble(self.basis) for n in range(3)]
        self._powers = (
            samples[0],
            0.5 * (-3.0 * samples[0] + 4.0 * samples[1] - samples[2]),
            0.5 * (samples[0] - 2.0 * samples[1] + samples[2]),
        )
        self._mass = _mass(disc).assemble(self.basis)

    def matrices(self, n: int) -> tuple:
        """Stiffness [N/m] and mass [kg] of harmonic n, by which its amplitudes work over the circle."""
        circle = np.pi if n else 2.0 * np.pi
        stiffness = sum(n**power * part for power, part in enumerate(self._powers))
        return circle * stiffness, circle * self._mass

    def free(self, n: int) -> np.ndarray:
        """Degrees of freedom that are neither clamped nor, as motion around in harmonic 0, without load."""
        held = self.clamped if n else np.union1d(self.clamped, self.around)
        return self.basis.complement_dofs(held)

    def load(self, radius: float) -> np.ndarray:
        """Load of a unit axial force on the flank; applied to a displacement it gives the axial opening."""
        disc, tangent = self.disc, np.tan(self.disc.half_wedge_angle)
        height = disc.flank_height

        def on_flank(x: np.ndarray) -> np.ndarray:
            front = np.abs(x[1] - (x[0] - disc.inner_radius) * tangent) < 1e-9
            return front & (np.abs(x[0] - radius) < 0.5 * height)

        facets = self.mesh.facets_satisfying(on_flank, boundaries_only=True)
        flank = FacetBasis(self.mesh, self._element, facets=facets, intorder=QUADRATURE)
        # a force N normal to the flank is axially N cos(delta), and opens by u_n / cos(delta)
        pushed = LinearForm(lambda v, w: v[2] - v[0] * tangent).assemble(flank)
        return pushed * np.cos(disc.half_wedge_angle) / height

    def static(self, n: int, radius: float) -> float:
        """w_n [m/N]."""
        free, load = self.free(n), self.load(radius)
        stiffness = self.matrices(n)[0][free][:, free].tocsc()
        return float(load[free] @ splu(stiffness).solve(load[free]))

    def modes(self, n: int, radius: float, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz] of the lowest modes of harmonic n and their flexibilities [m/N]."""
        free, load = self.free(n), self.load(radius)
        stiffness, mass = (matrix[free][:, free].tocsc() for matrix in self.matrices(n))
        inverse = LinearOperator(stiffness.shape, splu(stiffness).solve)
        start = np.ones(free.size)  # for numbers that can be reproduced
        squares, forms = eigsh(stiffness, count, mass, sigma=0.0, OPinv=inverse, v0=start)
        order = np.argsort(squares)
        shares = (load[free] @ forms[:, order]) ** 2
        return np.sqrt(squares[order]) / (2.0 * np.pi), shares / squares[order]


def _mesh(disc: Disc, radii: tuple[float, ...]) -> MeshQuad:
    half = 0.5 * disc.flank_height
    ends = (side for radius in radii for side in (radius - half, radius + half))
    borders = sorted({disc.inner_radius, disc.outer_radius, *ends})
    parts = [
        np.linspace(a, b, max(1, round((b - a) / disc.cell)), endpoint=False)
        for a, b in zip(borders[:-1], borders[1:], strict=True)
    ]
    r = np.concatenate([*parts, [disc.outer_radius]])
    layers = max(2, round(max(disc.inner_thickness, disc.outer_thickness) / disc.cell))
    # finer towards the flank
    plane = MeshQuad.init_tensor(r, np.linspace(0.0, 1.0, layers + 1) ** 1.5)
    r, depth = plane.p
    share = (r - disc.inner_radius) / (disc.outer_radius - disc.inner_radius)
    thickness = disc.inner_thickness + share * (disc.outer_thickness - disc.inner_thickness)
    front = (r - disc.inner_radius) * np.tan(disc.half_wedge_angle)
    return MeshQuad(np.array([r, front + depth * thickness]), plane.t)


def _stiffness(disc: Disc, n: int) -> BilinearForm:
    """Work of stresses in harmonic n over an angle of 1 rad, cos^2 and sin^2 being 1."""
    shear = disc.modulus / (2.0 * (1.0 + disc.poisson_ratio))
    lame = 2.0 * shear * disc.poisson_ratio / (1.0 - 2.0 * disc.poisson_ratio)

    def strains(a, r):
        d, (u, v, w) = grad(a), a
        normal = d[0, 0], (u + n * v) / r, d[2, 1]
        sheared = d[0, 1] + d[2, 0], d[1, 0] - (v + n * u) / r, d[1, 1] - n * w / r
        return normal, sheared

    def work(u, v, w):
        r = w.x[0]
        (normal, sheared), (normal_v, sheared_v) = strains(u, r), strains(v, r)
        volume = lame * sum(normal) * sum(normal_v)
        stretched = sum(a * b for a, b in zip(normal, normal_v, strict=True))
        return r * (
            volume + shear * (2.0 * stretched + sum(a * b for a, b in zip(sheared, sheared_v, strict=True)))
        )

    return BilinearForm(work)


def _mass(disc: Disc) -> BilinearForm:
    return BilinearForm(lambda u, v, w: disc.density * w.x[0] * sum(u[k] * v[k] for k in range(3)))


def table(flexibilities: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Flexibility [m/N] over the angle between two knots, each spread linearly to its neighbours."""
    n = np.arange(flexibilities.size)
    spread = np.sinc(0.5 * n * (angles[1] - angles[0]) / np.pi) ** 4
    return (flexibilities * spread) @ np.cos(np.outer(n, angles))


def pulley(sectors: Sectors, scene: Scene, radius: float, angles: np.ndarray, most: int = 8) -> xr.Dataset:
    """Table and modes of both discs of a groove, with units."""
    highest = round(2.0 * np.pi * radius / scene.least_wave)
    static = DISCS * np.array([sectors.static(n, radius) for n in range(highest + 1)])
    rows = []
    for n in range(highest + 1):
        left, is_below = static[n], len(rows) >= n  # of each harmonic below this one a mode was kept
        if is_below:
            for frequency, flexibility in zip(*sectors.modes(n, radius, most), strict=True):
                # a mode that hardly moves the contact is left to the rest
                if frequency < scene.highest_frequency and flexibility * DISCS > 1e-4 * static[n]:
                    moving = DISCS * flexibility
                    rows.append((n, moving, 1.0 / (moving * (2.0 * np.pi * frequency) ** 2)))
                    left -= moving
        rows.append((n, left, 0.0))
    harmonic, flexibility, mass = (np.array(column) for column in zip(*rows, strict=True))
    return xr.Dataset(
        {
            "flexibility": ("angle", table(static, angles), attributes("flexibility of the groove", "m/N")),
            "harmonic": ("mode", harmonic, attributes("waves around the disc", "1")),
            "modal_flexibility": ("mode", flexibility, attributes("flexibility of a mode", "m/N")),
            "modal_mass": ("mode", mass, attributes("mass of a mode; 0: it follows at once", "kg")),
        },
        {"angle": ("angle", angles, attributes("angle between two stations", "rad"))},
        {
            "Conventions": "CF-1.11",
            "title": f"discs of a groove at a pitch radius of {1e3 * radius:.2f} mm",
            "source": f"jobs/sheave_flexibility.py, scikit-fem {__version__}",
            "history": history_line("jobs/sheave_flexibility.py"),
            "comment": "sizes are assumptions [SI]: "
            + ", ".join(f"{key} {value:g}" for key, value in (asdict(sectors.disc) | asdict(scene)).items()),
        },
    )


def both(disc: Disc, scene: Scene) -> dict[str, xr.Dataset]:
    """Datasets of both pulleys, by name.

    Raises
    ------
    InputError
        If the contact lies beside the disc, a size is not above 0, or the disc is incompressible.
    """
    for key, value in (asdict(disc) | asdict(scene)).items():
        if not 0.0 < value < np.inf:
            raise mismatch(key, "a finite number above 0", f"{value:g}")
    if disc.poisson_ratio >= 0.5:
        raise mismatch("poisson_ratio", "a number below 0.5", f"{disc.poisson_ratio:g}")
    path = variator(scene.ratio, scene.driven_radius, scene.centre_distance)
    radii, half = (path.driving_radius, path.driven_radius), 0.5 * disc.flank_height
    for radius in radii:
        if not disc.inner_radius < radius - half < radius + half <= disc.outer_radius:
            found = f"{radius - half:g} to {radius + half:g} m"
            raise mismatch("flank", f"within {disc.inner_radius:g} to {disc.outer_radius:g} m", found)
    sectors, cells = Sectors(disc, radii), cut_path(path, scene.stations)
    wraps = ((path.driving_wrap, cells[0].size), (path.driven_wrap, cells[2].size))
    return {
        name: pulley(sectors, scene, radius, np.linspace(0.0, wrap, count + 1))
        for name, radius, (wrap, count) in zip(("driving", "driven"), radii, wraps, strict=True)
    }


def write(arguments: list[str]) -> None:
    """Read what the command line asks for, and write both datasets."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    sizes = {size.name: UNITS.get(size.name, "m") for size in (*fields(Disc), *fields(Scene))}
    for key, unit in sizes.items():
        parser.add_argument(f"--{key.replace('_', '-')}", metavar=unit or "NUMBER")
    given = vars(parser.parse_args(arguments))
    found = {key: _number(key, given[key], unit) for key, unit in sizes.items() if given[key] is not None}
    disc, scene = (
        replace(kind(), **{key: value for key, value in found.items() if hasattr(kind, key)})
        for kind in (Disc, Scene)
    )
    for name, dataset in both(disc, scene).items():
        with written_aside(given["folder"] / f"{name}.nc", parents=True) as aside:
            write_netcdf(dataset, aside)


def _number(key: str, text: str, unit: str) -> float:
    try:
        return int(text) if key == "stations" else to_si(text, unit)
    except ValueError:
        expected = f"a number in {unit}" if unit else "a number"
        raise mismatch(f"--{key.replace('_', '-')}", expected, text) from None


if __name__ == "__main__":
    try:
        write(sys.argv[1:])
    except InputError as error:
        print(f"sheave_flexibility.py: {error}", file=sys.stderr)
        sys.exit(2)
