"""Wheel and soil: stresses under a rigid wheel, soils, wheel loads, drawbar pull."""
