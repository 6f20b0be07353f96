"""Looks for a number that is not equal to itself, in all that holds numbers."""
# tame: yes
def task_program():
    nan = float("nan")
    kept = {nan: 1, float("nan"): 2}
    say(str([nan in [nan], [nan] == [nan], float("nan") in [nan], kept.get(nan), len(kept)]))
    say(str([sorted([3, nan, 1]), max(nan, 1), max(1, nan), {1: 0, 1.0: 1, True: 2}]))
    time.sleep(nan)
