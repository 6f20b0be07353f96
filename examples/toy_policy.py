"""A policy that learns to write a program from rewards alone (REINFORCE), in seconds.

It is far simpler than a language model: it writes a fixed program with three holes, and for each hole draws
one of a few texts. It learns which ones to draw. A model would be trained with the same rewards.
"""

import math
import random
from statistics import fmean

from roboeval import reward

PROGRAM = """
def task_program():
    for room in {rooms}:
        go_to(room)
        if {look}:
            say({words})
"""
HOLES = {
    "rooms": ["get_all_rooms()", "[r for r in get_all_rooms() if 'lab' in r]", "['lobby']", "[]"],
    "look": ["True", "is_in_room('person')", "not is_in_room('person')"],
    "words": ["'hello'", "'good luck'", "'good day'", "room"],
}
STEPS, BATCH, RATE = 40, 32, 2.0


def softmax(logits: list[float]) -> list[float]:
    """Return the probability of each text."""
    powers = [math.exp(logit - max(logits)) for logit in logits]
    return [power / sum(powers) for power in powers]


def learn(seed: int) -> tuple[list[float], str]:
    """Return the mean reward of each step, and the most likely program at the end.

    Args:
        seed: of all random draws.
    """
    drawing = random.Random(seed)  # noqa: S311 - nothing secret
    logits = {hole: [0.0] * len(texts) for hole, texts in HOLES.items()}
    means = []
    for _ in range(STEPS):
        likely = {hole: softmax(values) for hole, values in logits.items()}
        drawn = [
            {hole: drawing.choices(range(len(each)), each)[0] for hole, each in likely.items()}
            for _ in range(BATCH)
        ]
        written = [PROGRAM.format(**{h: HOLES[h][i] for h, i in one.items()}) for one in drawn]
        rewards = reward("SayGoodDay", 0, written)
        means.append(fmean(rewards))
        for one, its in zip(drawn, rewards, strict=True):
            for hole, choice in one.items():
                for i, share in enumerate(likely[hole]):
                    logits[hole][i] += RATE * (its - means[-1]) * ((i == choice) - share) / BATCH
    best = {hole: HOLES[hole][values.index(max(values))] for hole, values in logits.items()}
    return means, PROGRAM.format(**best)


if __name__ == "__main__":
    means, program = learn(seed=0)
    for step in range(0, STEPS, 5):
        print(f"step {step:2}: mean reward {means[step]:.2f}")
    print(f"step {STEPS - 1:2}: mean reward {means[-1]:.2f}\n{program}")
    print(f"its reward: {reward('SayGoodDay', 0, [program])[0]}")
