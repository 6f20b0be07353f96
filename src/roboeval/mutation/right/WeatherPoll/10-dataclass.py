# A poll is a dataclass.
import time
from dataclasses import dataclass, field


@dataclass
class Poll:
    votes: list = field(default_factory=list)

    def take(self):
        while not is_in_room("somebody"):
            time.sleep(15)
        self.votes.append(ask("somebody", "Is it hot outside today?", ["Yes", "No"]) == "Yes")

    @property
    def percent(self):
        return int(sum(self.votes) * 100 / len(self.votes))


def task_program():
    origin = get_current_location()
    poll = Poll()
    go_to("main entrance")
    while len(poll.votes) < 10:
        poll.take()
    go_to(origin)
    say(f"{poll.percent} per cent said yes.")
