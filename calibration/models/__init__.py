"""The trained networks that come with regolithd, and what opens and describes them."""

from __future__ import annotations

from pathlib import Path

TERRAIN_MODEL = Path(__file__).parent / "terrain.onnx"
"""The paper's network, frozen."""
POSTERIOR_MODEL = Path(__file__).parent / "posterior.onnx"
"""The posterior of cohesion, friction angle and drawbar margin."""
