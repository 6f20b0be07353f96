"""A robot simulated in pyrobosim. Start with `robot.py`, as `world.py` and `floorplan.py` import slowly."""
