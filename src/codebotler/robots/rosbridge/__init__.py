"""Robots behind a rosbridge. `robot.py` is the tool's side; `worker.py` speaks with the rosbridge.

The worker outlives a killed tool and cancels its goal; it shares parts of `ros1/worker/`.
"""
