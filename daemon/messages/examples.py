"""One example of each message, for the documents, with numbers like the paper's; its model validates it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from regolithd.daemon.pipeline.snapshot import BODY_QUANTITIES, WHEEL_QUANTITIES

if TYPE_CHECKING:
    from regolithd.daemon.messages.channels import Channel

_HEADER = {
    "late": False,
    "session": "20130611T140312Z-5f1c",
    "sequence": 500,
    "time": "2013-06-11T14:07:22.018291000Z",
    "time_ms": 1370959642018,
}
_WHEEL: dict[str, Any] = {each.name: None for each in WHEEL_QUANTITIES} | {
    "measured": True,
    "valid": True,
    "motor_current_A": 0.08,
    "motor_speed_rad_s": 410.7,
    "load_N": 31.6,
    "ground_speed_m_s": 0.0214,
    "motor_temperature_degC": None,
    "bus_voltage_V": None,
    "statusword": 4663,
    "wheel_torque_Nm": 1.284,
    "smoothed_torque_Nm": 1.279,
    "smoothed_load_N": 31.5,
    "slip": 0.025,
    "slip_source": "ground-speed",
    "cohesion_Pa": 3352.0,
    "friction_angle_rad": 0.4992,
    "outside_training_range": [],
}
_SNAPSHOT = {each.name: None for each in BODY_QUANTITIES} | {
    "model_version": "paper-3:64:2",
    "pitch_rad": 0.012,
    "roll_rad": -0.004,
    "yaw_rate_rad_s": 0.0,
    **{name: [value] * 6 for name, value in _WHEEL.items()},
}
_NODE = {
    "node_id": 13,
    "kind": "load-cell",
    "wheel": 3,
    "required": True,
    "phase": "lost",
    "nmt_state": "operational",
    "drive_state": None,
    "heard": "2013-06-11T14:07:21.301200000Z",
    "identity": None,
    "reason": None,
    "text": "node 13 (load-cell) lost: its heartbeat stopped 0.7 s ago",
    "boots": 1,
    "emergencies": 0,
}
_EMERGENCY = {
    "node_id": 3,
    "kind": "motor",
    "wheel": 3,
    "code": "0x8611",
    "register_bits": ["generic", "profile"],
    "vendor_bytes": "0000000000",
    "cleared": False,
    "text": "following error: the motor cannot follow its demand",
}
_ALARM = {
    "name": "node-13",
    "active": True,
    "severity": "error",
    "since": "2013-06-11T14:07:22.001700000Z",
    "text": "node 13 (load-cell) lost: its heartbeat stopped 0.7 s ago",
    "remedy": "Check its power and its connection. It is booted again as soon as its heartbeat returns.",
}
_ODOMETRY = {
    "x_m": 5.318,
    "y_m": -0.041,
    "heading_rad": -0.011,
    "distance_m": 5.321,
    "speed_m_s": 0.0214,
    "speed_source": "ground-speed",
    "heading_source": "yaw-rate",
    "gap_s": 0.0,
}
_HEALTH = {
    "uptime_s": 250.0,
    "cpu_s": 4.1,
    "memory_MB": 94.0,
    "bus_state": "active",
    "bus": {"received": 9106, "echoed": 3010, "kernel_drops": 0},
    "sync": {"produced": 501, "skipped": 0, "failed": 0, "worst_late_ms": 0.4, "mean_late_ms": 0.1},
    "acquisition": {
        "snapshots": 500,
        "accepted": 6000,
        "late": 0,
        "duplicate": 0,
        "unexpected": 0,
        "missing": 0,
        "doubtful": 0,
    },
    "undecodable": {"wrong-length": 2},
    "events_withheld": 0,
    "publishing": {
        "connections": 1,
        "queued": 0,
        "queued_MB": 0.4,
        "acknowledged": 540,
        "repeated": 0,
        "dropped": 0,
        "unstored": 0,
        "damaged": 0,
        "torn": 0,
    },
    "recording": {"file": "/var/lib/regolithd/recordings/20130611T140312Z.mcap", "free_MB": 21000.0, "problem": None},
    "tasks": {"network": 0.1, "recording": 0.2, "publishing": 0.3, "control": 0.2},
}
_INTERVAL = ("mean", "low_90", "low_50", "median", "high_50", "high_90")
_POSTERIOR = {
    "cohesion_Pa": dict(zip(_INTERVAL, (3370.0, 1900.0, 2760.0, 3350.0, 3960.0, 4800.0), strict=True)),
    "friction_angle_rad": dict(zip(_INTERVAL, (0.495, 0.42, 0.47, 0.5, 0.52, 0.56), strict=True)),
    "drawbar_margin": dict(zip(_INTERVAL, (0.295, 0.21, 0.27, 0.3, 0.32, 0.37), strict=True)),
    "wheels": 6,
    "instants": 20,
}
_EFFECT = {
    "name": "viscous-friction",
    "where": "all wheels",
    "statement": "Drag that grows with speed",
    "size": 4.1e-05,
    "unit": "A s/rad",
    "low": 3.6e-05,
    "high": 4.5e-05,
}
_MISMATCH = {
    "verdict": "missing-physics",
    "text": "The simulation leaves out: viscous-friction.",
    "effects": [_EFFECT],
    "changes": [],
    "recording": "traverse-20130611T140722Z.csv",
    "simulation": "SIM.toml",
    "report": "/var/lib/regolithd/recordings/comparisons/traverse-20130611T140722Z.html",
}
_REPORT = {
    "recording": "traverse-20130611T140722Z.csv",
    "html_gzip": "H4sIAAAAAAACA7NRTMlPLqksSFXIKMnNsQMASOy5hw8AAAA=",
}
_FIELDS: dict[str, dict[str, Any]] = {
    "state": {"sequence": 1, "state": "online", "reason": "connected", "software_version": "0.2.0"},
    "snapshot": _SNAPSHOT,
    "wheel": {"model_version": "paper-3:64:2", "wheel": 5, **_WHEEL},
    "posterior": {"sequence": 480, **_POSTERIOR},
    "odometry": {"sequence": 480, **_ODOMETRY},
    "node": {"sequence": 2, **_NODE},
    "emcy": {"sequence": 0, **_EMERGENCY},
    "event": {"sequence": 12, "kind": "node-lost", "node_id": 13, "text": _NODE["text"]},
    "alarm": {"sequence": 1, **_ALARM},
    "mismatch": {"sequence": 0, **_MISMATCH},
    "report": {"sequence": 0, **_REPORT},
    "health": {"sequence": 250, **_HEALTH},
}


def example(channel: Channel) -> dict[str, Any]:
    """Return an example of a channel's message as JSON would have it."""
    return channel.message.model_validate(_HEADER | _FIELDS[channel.name]).model_dump(mode="json")
