"""Tables from netCDF files: variables with units, files that nobody should trust, and one error for each."""

import h5py
import netCDF4
import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job

JOB = """name = "x"
model = "elastic_belt"
[deflection]
sheave_deformation = "flexibilities"
driving_flexibility_file = "driving.nc"
driven_flexibility_file = "driven.nc"
[mesh]
stations = 32
"""
ANGLES = np.linspace(0.0, 4.0, 9)
# of either sign: what is pressed here comes nearer over there
ROW = 1e-8 * (0.2 * (ANGLES == 0.0) + np.cos(ANGLES) + 0.5 * np.cos(2.0 * ANGLES))
MATRIX = ROW[np.abs(np.arange(9)[:, None] - np.arange(9))]


def write(path, values=ROW, units="m/N", dims=("angle",), angles=ANGLES, angle_units="rad", **kept):
    with netCDF4.Dataset(path, "w", **kept) as file:
        file.createDimension("angle", len(angles))
        place = file.createVariable("angle", "f8", ("angle",))
        place[:] = angles
        place.units = angle_units
        for dim in set(dims) - {"angle"}:
            file.createDimension(dim, len(angles))
        found = file.createVariable("flexibility", "f8", dims)
        found[:] = values
        if units:
            found.units = units
        file.createVariable("other", "f8", ())  # what is not asked for does not count


@pytest.fixture
def job(tmp_path):
    """Path of a job beside two tables."""
    for pulley in ("driving", "driven"):
        write(tmp_path / f"{pulley}.nc")
    (tmp_path / "x.toml").write_text(JOB)
    return tmp_path / "x.toml"


def loaded(job, pulley="driving"):
    parameters = load_job(job).parameters
    return parameters[f"{pulley}_flexibility_angle"], np.array(parameters[f"{pulley}_flexibility"])


def refusal(job):
    with pytest.raises(InputError) as error:
        load_job(job)
    prefix = f"{job}: [deflection] driving_flexibility_file: {job.parent / 'driving.nc'}"
    text = str(error.value)
    assert text.startswith(prefix) and "\n" not in text
    return text.removeprefix(prefix)


def test_a_variable_over_the_angle_is_a_row_and_one_over_both_a_matrix(job):
    angles, row = loaded(job)
    assert angles == tuple(ANGLES) and np.array_equal(row, [ROW])
    write(job.parent / "driving.nc", MATRIX, dims=("angle", "angle"))
    angles, matrix = loaded(job)
    assert angles == tuple(ANGLES) and np.array_equal(matrix, MATRIX)


def test_the_rows_have_their_own_angles_where_their_dimension_has(job):
    write(job.parent / "driving.nc", MATRIX[::-1], dims=("other_angle", "angle"))
    with netCDF4.Dataset(job.parent / "driving.nc", "a") as file:
        file.createVariable("other_angle", "f8", ("other_angle",))[:] = ANGLES[::-1]
        file["other_angle"].units = "rad"
    assert np.array_equal(loaded(job)[1], MATRIX)


@pytest.mark.parametrize("kept", [{}, {"format": "NETCDF3_CLASSIC"}])
def test_units_are_converted(job, kept):
    write(
        job.parent / "driving.nc", 1e6 * ROW, "mm/kN", angles=np.rad2deg(ANGLES), angle_units="degree", **kept
    )
    angles, row = loaded(job)
    assert angles == pytest.approx(ANGLES) and row[0] == pytest.approx(ROW, rel=1e-15)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"units": "N/m"}, ', flexibility: expected units flexibility [m/N], found "N/m"'),
        ({"units": ""}, ", flexibility: expected units flexibility [m/N], found none"),
        ({"angle_units": "m"}, ', angle: expected units angle [rad], found "m"'),
        ({"values": np.full(9, np.nan)}, ", flexibility: expected finite numbers, found others"),
        (
            {"values": MATRIX, "dims": ("row", "angle")},
            ", flexibility: expected dimensions among angle, other_angle, found row x angle",
        ),
        ({"dims": ("row",), "values": ROW}, ", flexibility: expected over angle, found over row"),
    ],
)
def test_what_is_no_table_gets_one_line(job, changed, told):
    write(job.parent / "driving.nc", **changed)
    assert refusal(job) == told


@pytest.mark.parametrize(
    ("values", "dims", "told"),
    [
        (MATRIX + 1e-9 * np.eye(9, k=1), ("angle", "angle"), "a symmetric matrix, by Maxwell and Betti"),
        (ROW - 0.5 * ROW[0], ("angle",), "a positive definite matrix, since no force gains work"),
    ],
)
def test_what_no_disc_has_gets_one_line(job, values, dims, told):
    write(job.parent / "driving.nc", values, dims=dims)
    with pytest.raises(InputError, match=f"driving_flexibility: expected {told}"):
        load_job(job)


def test_what_is_no_number_gets_one_line(job):
    with netCDF4.Dataset(job.parent / "driving.nc", "a") as file:
        file["flexibility"].scale_factor = "x"
    assert refusal(job).startswith(", flexibility: expected numbers that can be unpacked, found ")
    with netCDF4.Dataset(job.parent / "driving.nc", "w") as file:
        file.createDimension("angle", 9)
        for name in ("angle", "flexibility"):
            file.createVariable(name, str, ("angle",))
    assert refusal(job) == ", angle: expected numbers, found something else"


def test_a_missing_variable_names_those_that_are_there(job):
    with netCDF4.Dataset(job.parent / "driving.nc", "a") as file:
        file.renameVariable("flexibility", "flexibilty")
    assert refusal(job).startswith(
        ": expected a variable flexibility [m/N], found none among angle, flexibilty"
    )


def test_files_that_are_none_get_one_line(job):
    table = job.parent / "driving.nc"
    table.write_bytes(b"\x89HDF\r\n\x1a\n and no more")
    assert refusal(job) == ": expected a netCDF file, found one that is damaged"
    table.write_bytes(b"angle,flexibility\n0,1\n")
    assert refusal(job).startswith(": expected a netCDF file, found ")
    table.unlink()
    assert refusal(job).startswith(": expected a netCDF file, found nothing; did you mean")
    table.symlink_to(job.parent / "driven.nc")
    assert refusal(job) == ": expected a netCDF file, found a link in the place of a file"


def test_nothing_is_read_from_elsewhere(job):
    table, other = job.parent / "driving.nc", job.parent / "driven.nc"
    (job.parent / "raw").write_bytes(ROW.tobytes())
    layout = h5py.VirtualLayout((9,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "flexibility", (9,))
    makers = {
        "a link": lambda file: file.__setitem__("flexibility", h5py.ExternalLink(str(other), "/flexibility")),
        "values in another one": lambda file: file.create_virtual_dataset("flexibility", layout),
        "values in another one ": lambda file: file.create_dataset(
            "flexibility", (9,), "f8", external=[(str(job.parent / "raw"), 0, 72)]
        ),
        "a group": lambda file: file.create_group("flexibility"),
    }
    for found, make in makers.items():
        for block in (0, 512):  # of the user's, before all that is HDF5
            with h5py.File(table, "w", userblock_size=block) as file:
                file["angle"] = ANGLES
                make(file)
            assert refusal(job).startswith(", flexibility: expected ")
            assert refusal(job).endswith(f", found {found.strip()}")


def test_a_few_bytes_for_many_values_are_refused(job):
    with netCDF4.Dataset(job.parent / "driving.nc", "w") as file:
        file.createDimension("angle", 2**22 + 1)
        for name, units in (("angle", "rad"), ("flexibility", "m/N")):
            file.createVariable(name, "f4", ("angle",), zlib=True).units = units
    assert refusal(job) == ", angle: expected at most 4194304 values, found 4194305"
