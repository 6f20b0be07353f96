# All sentences in one breath.
def task_program():
    start = get_current_location()
    sentences = []
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if not is_in_room("stapler"):
                sentences.append(f"{room} has no stapler.".capitalize())
    go_to(start)
    if sentences:
        say(" ".join(sentences))
    else:
        say("No printer room lacks a stapler.")
