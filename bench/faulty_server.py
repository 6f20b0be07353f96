"""Measures the cost of a run if one request in ten fails, and tests that each completion is stored once.

    python bench/faulty_server.py [COMPLETIONS OF EACH PROMPT] [MODEL ...]

`roboeval generate` requests 50 completions of 80 prompts from a server in this process, over both protocols.
One request in ten gets an error, a refusal, a stream that breaks off, or nonsense. The script prints the
total time, and the processor time of the command per completion. This includes the client, retries, and
writing each reply to the disk before it counts. bench/generate.py measures the client's share.
"""

import json
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests" / "codebotler" / "models"))

from server import Fault, Request, Server

SHARE = 0.1  # share of requests that fail
FAULTS = (Fault.SERVER_ERROR, Fault.TOO_MANY, Fault.CUT, Fault.INVALID_JSON, Fault.HUNG_UP, Fault.NOTHING)
CONCURRENCY = 32


def main() -> None:
    """Print a line for each protocol."""
    each = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    dice = random.Random(0)
    failed = 0

    def fault(_request: Request) -> Fault | None:
        nonlocal failed
        fails = dice.random() < SHARE
        failed += fails
        return dice.choice(FAULTS) if fails else None

    environment = {name: value for name, value in os.environ.items() if name != "OPENAI_API_KEY"}
    for model in sys.argv[2:] or ("completions:m", "openai:m"):
        with tempfile.TemporaryDirectory() as folder, Server(fault=fault) as server:
            failed = 0
            words = ["generate", "--model", model, "--base-url", server.url, "--out", f"{folder}/run"]
            words += ["--num-completions", str(each), "--concurrency", str(CONCURRENCY)]
            start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(
                [sys.executable, "-m", "roboeval", *words],
                check=True,
                env=environment,
                stderr=subprocess.DEVNULL,
            )
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            lines = Path(folder, "run", "completions.jsonl").read_text().splitlines()
            keys = [(row["task"], row["prompt"], row["index"]) for row in map(json.loads, lines)]
            twice = json.loads(Path(folder, "run", "run.json").read_text())["possibly_paid_twice"]
            print(
                f"{model}: {len(keys)} completions, {len(set(keys))} distinct of {80 * each}, from "
                f"{len(server.requests)} requests, {failed} of which failed, in "
                f"{time.perf_counter() - start:.1f} s; {1000 * used / len(keys):.1f} ms of processor time "
                f"each; {twice} possibly paid twice"
            )
            if len(keys) != 80 * each or len(set(keys)) != 80 * each or not failed:
                sys.exit("some completion is missing or stored twice, or no request failed")


if __name__ == "__main__":
    main()
