"""Tries to fail in the engine's part by watching it, where Python can."""
# ends: timeout TimeoutError


def task_program():
    monitoring = getattr(sys, "monitoring", None)
    if monitoring is not None:
        monitoring.use_tool_id(0, "tool")
        monitoring.register_callback(0, monitoring.events.PY_START, lambda *_: None)
        monitoring.set_events(0, monitoring.events.PY_START)
    while True:
        pass
