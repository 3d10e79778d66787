"""The table of results: one row a run. A change of columns is a new version."""

from __future__ import annotations

from typing import Any, NamedTuple

VERSION = 1


class Column(NamedTuple):
    """A column: name, type, unit, what it says; better: "low" or "high" where one end is better.

    floor: what counts as nothing, so that ratios of round-off stay out of the comparisons.
    """

    name: str
    kind: str  # text, whole, number, flag, numbers, texts, tasks, counts
    unit: str
    says: str
    better: str = ""
    floor: float = 0.0


COLUMNS = (
    Column("schema", "whole", "", "version of these columns"),
    Column("key", "text", "", "what this run is: changes with scenario, method, level, repetition, seed"),
    Column("set", "text", "", "the scenario's file"),
    Column("scenario", "text", "", "its name"),
    Column("digest", "text", "", "changes with the scenario's content"),
    Column("robot", "text", "", "its robot"),
    Column("solver", "text", "", "the method, or the peer"),
    Column("parameters", "text", "", "the method's parameters as JSON"),
    Column("peer", "flag", "", "whether it is another project's"),
    Column("level", "text", "", "velocity, acceleration or torque"),
    Column("repeat", "whole", "", "0, 1, ... under the same seed"),
    Column("seed", "whole", "", "of random starts"),
    Column("q0", "numbers", "", "where it started, Pinocchio's nq"),
    Column("outcome", "text", "", "done, refused, skipped, failed or ran away"),
    Column("reason", "text", "", "why not done"),
    Column("warnings", "texts", "", "what was said on the way"),
    Column("valid", "flag", "", "done, inside all limits and clear of all obstacles after settling"),
    Column("solved", "flag", "", "valid, and the first task's RMS error within tolerance"),
    Column("steps", "whole", "", "steps made"),
    Column("dt", "number", "s", "one step"),
    Column("rms_m", "number", "m", "RMS error of the first task's position", "low", 1e-6),
    Column("max_m", "number", "m", "its largest", "low", 1e-6),
    Column("final_m", "number", "m", "its last", "low", 1e-6),
    Column("rms_rad", "number", "rad", "RMS error of the first task's orientation", "low", 1e-6),
    Column("max_rad", "number", "rad", "its largest", "low", 1e-6),
    Column("final_rad", "number", "rad", "its last", "low", 1e-6),
    Column("scale_mean", "number", "", "share of the first task's command delivered, mean", "high", 1e-3),
    Column("scale_min", "number", "", "its least", "high", 1e-3),
    Column("delay", "number", "s", "by how much the path waited, at the end", "low", 1e-3),
    Column("violations", "whole", "samples", "outside a limit after settling, summed over joints", "low", 1.0),
    Column("margin", "number", "rad or m", "least distance to a position limit, negative outside", "high", 1e-3),
    Column("velocity_share", "number", "", "peak rate over its limit", "low", 1e-3),
    Column("acceleration_share", "number", "", "peak acceleration over its limit", "low", 1e-3),
    Column("torque_share", "number", "", "peak torque over its limit, of driven runs", "low", 1e-3),
    Column("clearance", "number", "m", "least distance to an obstacle, negative inside", "high", 1e-4),
    Column("effort", "number", "rad^2/s", "integral of v^2", "low", 1e-6),
    Column("torque_effort", "number", "N^2 m^2 s", "integral of torque^2", "low", 1e-6),
    Column("energy", "number", "J", "integral of |torque x rate|: of motors that recover nothing", "low", 1e-6),
    Column("peak_torque", "number", "N m", "largest torque of any joint", "low", 1e-6),
    Column("torque_source", "text", "", "driven, or inverse dynamics of a kinematic run"),
    Column("manipulability", "number", "", "least product of the first task's singular values", "high", 1e-6),
    Column("sigma_min", "number", "", "least singular value of any task", "high", 1e-6),
    Column("jerk_rms", "number", "rad/s^3", "RMS over joints and time", "low", 1e-3),
    Column("jerk_peak", "number", "rad/s^3", "largest of any joint", "low", 1e-3),
    Column("flips", "whole", "", "reversals of a joint's rate", "low", 1.0),
    Column("power_above_3hz", "number", "", "share of the rates' power above 3 Hz", "low", 1e-6),
    Column("drift", "number", "rad or m", "largest joint distance between the ends of a lap", "low", 1e-6),
    Column(
        "null_motion", "number", "rad or m", "length of the joints' way in the first task's null space", "low", 1e-6
    ),
    Column("step_p50", "number", "s", "median time of a step", "low", 1e-7),
    Column("step_p99", "number", "s", "its 99th percentile", "low", 1e-7),
    Column("status", "counts", "", "steps by status"),
    Column("tasks", "tasks", "", "the figures of every task"),
    Column("scenario_json", "text", "", "the scenario itself, so that the run can be made again"),
    Column("started", "text", "", "when, UTC"),
    Column("wall", "number", "s", "time it took"),
    Column("machine", "text", "", "where"),
    Column("versions", "text", "", "of the packages that count, as JSON"),
)
BY_NAME = {column.name: column for column in COLUMNS}
FIGURES = tuple(column.name for column in COLUMNS if column.better)
TIMES = ("step_p50", "step_p99")
TASK_FIELDS = (
    "rms_m", "max_m", "final_m", "rms_rad", "max_rad", "final_rad", "min_singular_value", "min_scale",
)  # fmt: skip


def arrow() -> Any:
    """The pyarrow schema, its version in the metadata."""
    import pyarrow as pa

    task = pa.struct([("name", pa.string()), *((name, pa.float64()) for name in TASK_FIELDS)])
    kinds = {
        "text": pa.string(),
        "whole": pa.int64(),
        "number": pa.float64(),
        "flag": pa.bool_(),
        "numbers": pa.list_(pa.float64()),
        "texts": pa.list_(pa.string()),
        "tasks": pa.list_(task),
        "counts": pa.list_(pa.struct([("status", pa.string()), ("steps", pa.int64())])),
    }
    described = [pa.field(c.name, kinds[c.kind], metadata={"unit": c.unit, "says": c.says}) for c in COLUMNS]
    return pa.schema(described, metadata={"cartctl.bench.schema": str(VERSION)})
