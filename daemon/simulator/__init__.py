"""The virtual rover's world: scenario, wheels on soil, sensor noise."""
