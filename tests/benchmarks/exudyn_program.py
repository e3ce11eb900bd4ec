"""The belt drive of `exudyn_belt_drive.py` in EXUDYN, started by that script with the interpreter that has it.

python exudyn_program.py SCENE.npz OUT.npz

Cables of ANCF elements with reduced integration, one contact object for each of them and each pulley, the
trapezoidal rule for constraints of index 2, as in EXUDYN's own examples of belt drives.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import Any

import exudyn as exu
import exudyn.itemInterface as items  # noqa: N813 - its name
import numpy as np

MIXED = 2  # useReducedOrderIntegration: by Lobatto and Gauss, which spares the axial strain its waves
DISCONTINUOUS_TOLERANCE, MOST_DISCONTINUOUS = 1e-3, 5  # as in EXUDYN's examples


def drive(scene: Mapping[str, Any]) -> tuple[Any, dict[str, list[int]]]:
    """Return the system of a belt on two pulleys, and its sensors.

    Parameters
    ----------
    scene : mapping
        What `exudyn_belt_drive.scene_of` writes.
    """
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0)
    )
    nodes = [
        mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=list(q), initialVelocities=list(v)))
        for q, v in zip(scene["positions"], scene["speeds"], strict=True)
    ]
    belt = {key: float(scene[key]) for key in ("massPerLength", "axialStiffness", "bendingStiffness")}
    belt |= {key: float(scene[key]) for key in ("axialDamping", "bendingDamping", "referenceAxialStrain")}
    cables = [
        mbs.AddObject(
            items.ObjectANCFCable2D(
                **belt,
                length=float(length),
                nodeNumbers=[nodes[i], nodes[(i + 1) % len(nodes)]],
                useReducedOrderIntegration=MIXED,
            )
        )
        for i, length in enumerate(scene["lengths"])
    ]
    sensors: dict[str, list[int]] = {
        "positions": [_sensor(mbs, items.SensorNode, "Coordinates", nodeNumber=n) for n in nodes],
        "slip": [],
        "force": [],
    }
    for pulley in range(2):
        wheel, body = _pulley(mbs, ground, scene, pulley)
        if pulley == 1:
            sensors["driven"] = [_sensor(mbs, items.SensorNode, "AngularVelocity", nodeNumber=wheel)]
        touching = _contacts(mbs, mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=body)), cables, scene)
        sensors["slip"] += [
            _sensor(mbs, items.SensorObject, "Coordinates_t", objectNumber=k) for k in touching
        ]
        sensors["force"] += [_sensor(mbs, items.SensorObject, "ForceLocal", objectNumber=k) for k in touching]
    mbs.Assemble()
    return mbs, sensors


def _sensor(mbs: Any, kind: Any, quantity: str, **of: int) -> int:
    return mbs.AddSensor(
        kind(**of, storeInternal=True, outputVariableType=getattr(exu.OutputVariableType, quantity))
    )


def _pulley(mbs: Any, ground: int, scene: Mapping[str, Any], pulley: int) -> tuple[int, int]:
    """Add one: the first of a given speed, the second with a torque over time; its node and its body."""
    speed = float(scene["pulleySpeeds"][pulley])
    node = mbs.AddNode(
        items.NodeRigidBody2D(
            referenceCoordinates=[float(scene["centres"][pulley]), 0.0, 0.0],
            initialVelocities=[0.0, 0.0, speed],
        )
    )
    inertia = float(scene["inertia"])
    body = mbs.AddObject(items.ObjectRigidBody2D(mass=1.0, inertia=inertia, nodeNumber=node))
    markers = [mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=k)) for k in range(3)]
    for marker in markers[:2]:
        mbs.AddObject(items.CoordinateConstraint(markerNumbers=[ground, marker]))
    if pulley == 0:
        mbs.AddObject(
            items.CoordinateConstraint(markerNumbers=[ground, markers[2]], velocityLevel=True, offset=speed)
        )
        return node, body
    times, torques = scene["torqueTimes"], scene["torques"]

    def torque(_: Any, now: float, __: float) -> float:
        return float(np.interp(now, times, torques))

    mbs.AddLoad(items.LoadCoordinate(markerNumber=markers[2], load=0.0, loadUserFunction=torque))
    return node, body


def _contacts(mbs: Any, wheel: int, cables: list[int], scene: Mapping[str, Any]) -> list[int]:
    """Let each element touch a pulley."""
    count = int(scene["segments"])
    found = []
    for cable, length in zip(cables, scene["lengths"], strict=True):
        segment = float(length) / count
        shape = mbs.AddMarker(items.MarkerBodyCable2DShape(bodyNumber=cable, numberOfSegments=count))
        history = [0.1] * count + [-2.0] * count + [0.0] * count  # no contact, not known whether it sticks
        data = mbs.AddNode(
            items.NodeGenericData(initialCoordinates=history, numberOfDataCoordinates=3 * count)
        )
        contact = items.ObjectContactFrictionCircleCable2D(
            markerNumbers=[wheel, shape],
            nodeNumber=data,
            numberOfContactSegments=count,
            contactStiffness=segment * float(scene["contactStiffness"]),
            contactDamping=segment * float(scene["contactDamping"]),
            frictionVelocityPenalty=segment * float(scene["frictionVelocityPenalty"]),
            frictionStiffness=segment * float(scene["frictionStiffness"]),
            frictionCoefficient=float(scene["friction"]),
            circleRadius=float(scene["radius"]),
            useSegmentNormals=bool(scene["segmentNormals"]),
        )
        found.append(mbs.AddObject(contact))
    return found


def march(mbs: Any, scene: Mapping[str, Any]) -> float:
    """March to the end; return the core-seconds that it took."""
    settings = exu.SimulationSettings()
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.parallel.numberOfThreads = 1
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = float(scene["interval"])
    integration = settings.timeIntegration
    integration.endTime = float(scene["duration"])
    integration.numberOfSteps = round(float(scene["duration"]) / float(scene["step"]))
    integration.verboseMode = 0
    integration.newton.useModifiedNewton = True
    integration.discontinuous.iterationTolerance = DISCONTINUOUS_TOLERANCE
    integration.discontinuous.maxIterations = MOST_DISCONTINUOUS
    began = time.process_time()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    return time.process_time() - began


def main(scene_file: str, out_file: str) -> None:
    """Do the run of a scene, and write what its sensors have seen."""
    with np.load(scene_file) as file:
        scene = dict(file)
    mbs, sensors = drive(scene)
    core_seconds = march(mbs, scene)
    seen = {
        name: np.stack([mbs.GetSensorStoredData(k)[:, 1:] for k in numbers], 1)
        for name, numbers in sensors.items()
    }
    np.savez(out_file, core_seconds=core_seconds, version=exu.config.Version(), **seen)


if __name__ == "__main__":
    main(*sys.argv[1:])
