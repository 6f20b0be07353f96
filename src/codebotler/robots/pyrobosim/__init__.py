"""A robot simulated in pyrobosim; start with `robot.py`. `world.py` and `floorplan.py` import slowly."""
