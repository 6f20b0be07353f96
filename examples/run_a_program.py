"""Run a program in a simulated world, in three lines."""

from codebotler.core.world import Person, Room, World
from codebotler.simulator import run

house = World((Room("lobby"), Room("kitchen", objects=("mug",), people=(Person("amy", ("yes",)),))), "lobby")
outcome = run("def task_program():\n    go_to('kitchen')\n    say(str(is_in_room('mug')))", house)
print(outcome.status.value, *(f"{event.kind}: {event.text}" for event in outcome.trace), sep="\n")
