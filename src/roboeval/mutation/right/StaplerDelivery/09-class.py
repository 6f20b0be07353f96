# A courier is an object.
class Courier:
    def __init__(self, thing, source):
        self.thing, self.source = thing, source

    def bring_to(self, room):
        go_to(self.source)
        pick(self.thing)
        go_to(room)
        place(self.thing)


def task_program():
    courier = Courier("stapler", "supply room")
    rooms = sorted(room for room in get_all_rooms() if "printer room" in room)
    seen = []
    for room in rooms:
        go_to(room)
        seen.append((room, is_in_room(courier.thing)))
    for room, there in seen:
        if not there:
            courier.bring_to(room)
    say("Every printer room has a stapler now.")
