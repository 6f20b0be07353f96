"""The play that a fork server runs itself before it serves: a little of all that most programs do.

What the interpreter learns by it, such as where it finds an attribute, lies in memory that the children of
the fork server then share.
"""

from __future__ import annotations

import marshal

from codebotler.core.world import Person, Room, World
from codebotler.simulator.sandbox import WITHOUT_REFERENCES
from codebotler.simulator.sandbox.fuel import prepared

STAGE = World((Room("hall"), Room("kitchen", ("mug",), (Person("ann", ("yes",)),))), "hall")

TEXT = """
def find(thing, rooms):
    for number, room in enumerate(sorted(rooms)):
        go_to(room)
        if is_in_room(thing):
            return [room, number + 1]
    return None

def task_program():
    start = get_current_location()
    rooms = [room for room in get_all_rooms() if room != start and "all" not in room]
    found = find("mug", rooms)
    if found is not None and len(found) > 0:
        pick("mug")
        answer = ask("", "Is it yours, " + found[0] + "?", ["Yes", "No"])
        counts = {"yes": 0}
        counts[answer.lower()] = counts.get("yes", 0) + 1
        time.sleep(1)
        place("mug")
    try:
        go_to("nowhere")
    except Exception as error:
        say(str(error))
    go_to(start)
    message = f"{', '.join(rooms)}: {counts['yes']} of {len(rooms)}"
    while not message.endswith("."):
        message += "."
    say(message)
"""

PLAY = marshal.dumps(prepared(TEXT, lowercase=False)[0], WITHOUT_REFERENCES)

LESSONS = 20
"""How often it is run: the interpreter learns from what it has done a few times."""
