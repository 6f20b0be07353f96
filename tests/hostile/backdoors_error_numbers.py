"""Tries to name a failure of the robot that there was not."""
# ends: killed Crash
# does: goto nowhere


def task_program():
    try:
        go_to("nowhere")
    except Exception as error:
        error.number = 7
        raise
