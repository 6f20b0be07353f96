"""Tries to fail in the engine's part by tracing it."""
# ends: python-error PermissionError


def task_program():
    def tracer(frame, event, argument):
        if frame.f_code.co_name == "ended_by":
            raise KeyError
        return tracer
    sys.settrace(tracer)
    1 / 0
