"""Meets the limit of calls inside what a builtin calls."""
# tame: yes
def task_program():
    for number in range(100):
        try:
            list(map(say, ["x"] * 600))
        except Exception:
            pass
