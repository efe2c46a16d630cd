"""How good the estimators and the alarm are, on rovers and soils that none of them has seen: `regolithd evaluate`.

Each module answers one question and returns one flat dictionary of figures.
"""
