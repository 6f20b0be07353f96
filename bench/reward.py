"""How many programs a minute are rewarded? All are distinct, so that none is remembered; batches of 64.

Beside it stands what one call of `evaluate` does with the same programs, as what could be reached. Both are
printed for the suites `paper` and `plus`; under `plus`, which has more worlds, a quarter as many programs.
"""

import sys
import time
from itertools import cycle, islice

from roboeval import Completion, evaluate, load_suite, recorded_completions, reward

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 2_000
BATCH = 64
WORKERS = 2


def main() -> None:
    """Print both for both suites."""
    for name, count in (("paper", COUNT), ("plus", COUNT // 4)):
        measure(name, count)


def measure(name: str, count: int) -> None:
    """Print both for one suite."""
    suite = load_suite(name)
    recorded = [
        completion
        for model in ("recorded:careful", "recorded:hasty")
        for completion in recorded_completions(model, suite)
    ]
    written: dict[str, list[str]] = {}
    for number, completion in enumerate(islice(cycle(recorded), count)):
        written.setdefault(completion.task, []).append(f"{completion.program}\n# {number}\n")
    first = time.monotonic()
    reward("LunchTime", 0, ["", "def task_program():\n    pass\n"], suite=suite)
    began = time.monotonic()
    for task, programs in written.items():
        for start in range(0, len(programs), BATCH):
            reward(task, 0, programs[start : start + BATCH], suite=suite)
    took = time.monotonic() - began
    print(f"{name}: {count:,} distinct programs in {took:.1f} s: {60 * count / took:,.0f} programs a minute")
    print(f"the first call, which starts the engine: {began - first:.2f} s")
    began = time.monotonic()
    for task, programs in written.items():
        for start in range(0, len(programs), BATCH):
            reward(task, 0, programs[start : start + BATCH], suite=suite)
    print(f"the same again, remembered: {60 * count / (time.monotonic() - began):,.0f} programs a minute")
    completions = [
        Completion(task=task, prompt=0, index=index, program=program)
        for task, programs in written.items()
        for index, program in enumerate(programs)
    ]
    began = time.monotonic()
    for _ in evaluate(completions, suite, workers=WORKERS):
        pass
    took = time.monotonic() - began
    print(f"evaluate, {WORKERS} workers, one call: {60 * count / took:,.0f} programs a minute")


if __name__ == "__main__":
    main()
