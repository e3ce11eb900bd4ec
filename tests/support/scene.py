"""The variator of the tests: softer collars than those of the defaults, so that much happens at moderate loads.

Between them the belt vibrates from 110 N m on at -0.8 s/m and from 90 N m on where friction falls more steeply, and
nothing lags, so that closed forms hold. Tests that use it do not depend on the defaults, which are fitted.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from cvt_hpc.models.elastic_belt import PARAMETERS

# [SI]; of all belts on sheaves, and of the elastic one
OF_BELTS = {"transverse_damping": 500.0, "friction_memory": 0.3e-3, "tilt_lag": 0.0}
SCENE = OF_BELTS | {
    "tilt_stiffness": 3e5,
    "local_stiffness": 4e9,
    "local_length": 0.012,
    "friction_speed": 0.03,
}

# All parameters of the elastic belt
VALUES: Mapping[str, Any] = MappingProxyType(
    {key: parameter.default for section in PARAMETERS.values() for key, parameter in section.items()} | SCENE
)
