"""The robot in pyrobosim: start with `robot.py`.

`world.py` and `floorplan.py` build the world; importing them needs pyrobosim and takes a second.
"""
