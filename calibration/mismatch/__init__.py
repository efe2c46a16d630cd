"""Find the physics that a simulation leaves out: locate, name, fit, and show the fit improve.

    recording = read_recording(path)
    simulation = load_simulation(tables)
    comparison = compare(recording, simulation)

`candidates/` holds the physics, one small file each; `simulation.py` says what a simulation must tell about itself.
"""
