"""Tries to stop what counts its turns by watching every function, where Python can."""
# ends: timeout TimeoutError

import operator


def task_program():
    monitoring = getattr(sys, "monitoring", None)
    if monitoring is not None:
        monitoring.use_tool_id(0, "tool")
        monitoring.register_callback(0, monitoring.events.PY_START, operator.is_)
        monitoring.set_events(0, monitoring.events.PY_START)
    while True:
        pass
