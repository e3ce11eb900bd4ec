"""Parameters of the belt's bending: curvature terms, and the moment of the pressed elements."""

from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive

CURVATURE_TERMS = ("none", "path", "straight")
EDGES = ("outer_edge", "inner_edge")

BENDING: dict[str, Parameter] = {
    "curvature_terms": Parameter(
        "none",
        "",
        "terms of the path's curvature in the transverse motion (Bullinger et al. 2005, eqs 14-21): none, or "
        "those of a belt with the path as shape at rest, or of a belt straight at rest",
        choices=CURVATURE_TERMS,
    ),
    "column_bending": Parameter(
        "off",
        "",
        "rocking: pressed elements bear a bending moment, and rock on the edges of their faces (eqs 22-24)",
        choices=("off", "rocking"),
    ),
    "column_stiffness": positive(
        0.5,
        "N m^2",
        "EI of the pressed elements while their faces rest on each other",
        sensible=(0.0001, 10000.0),
    ),
    "outer_edge": not_negative(
        1e-3,
        "m",
        "k+: from the pitch line outwards to the edge of the elements' faces",
        sensible=(1e-6, 0.05),
    ),
    "inner_edge": not_negative(
        0.0, "m", "k-: from the pitch line inwards to the edge of the elements' faces", sensible=(1e-6, 0.05)
    ),
}

BENDING_DEFAULTS = {key: parameter.default for key, parameter in BENDING.items()}


def has_column(parameters: Parameters) -> bool:
    """Whether pressed elements bear a bending moment."""
    return bool(parameters.get("column_bending", "off") == "rocking")


def bending_problems(parameters: Parameters) -> list[Problem]:
    """Problems of the belt's bending: (key, expected, found)."""
    p = BENDING_DEFAULTS | dict(parameters)
    if p["curvature_terms"] != "none" and p["longitudinal_mass"] != 1.0:
        return [("curvature_terms", "none with longitudinal_mass other than 1", p["curvature_terms"])]
    return []


def bending_inert(parameters: Parameters) -> dict[str, str]:
    """Settings of the belt's bending without effect, each with the setting that makes it so."""
    if has_column(parameters):
        return {}
    return dict.fromkeys(("column_stiffness", *EDGES), "column_bending off")
