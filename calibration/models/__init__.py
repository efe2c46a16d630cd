"""Trained networks that are shipped with regolithd (ONNX), how they are opened, and their model card."""

from __future__ import annotations

from pathlib import Path

TERRAIN_MODEL = Path(__file__).parent / "terrain.onnx"
"""The paper's network: cohesion and tan φ from load, slip and motor current."""
POSTERIOR_MODEL = Path(__file__).parent / "posterior.onnx"
"""The posterior network: mixture over cohesion, friction angle and drawbar margin."""
