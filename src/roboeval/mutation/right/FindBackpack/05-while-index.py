# An index that counts up.
def task_program():
    start = get_current_location()
    candidates = []
    for r in get_all_rooms():
        if "conference" in r:
            candidates.append(r)
    i = 0
    while i < len(candidates):
        go_to(candidates[i])
        if is_in_room("backpack"):
            break
        i += 1
    if i < len(candidates):
        pick("backpack")
        go_to(start)
        place("backpack")
    else:
        go_to(start)
        say("I did not find the backpack, sorry.")
