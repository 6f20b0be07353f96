"""Robots behind a rosbridge: start with `robot.py`.

`protocol.py` has the messages; `watchdog.py` outlives a killed tool and cancels its goal.
"""
