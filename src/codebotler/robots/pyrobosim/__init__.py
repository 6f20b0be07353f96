"""The robot in pyrobosim; start with `robot.py`. Importing `world.py` and `floorplan.py` takes a second."""
