# Booleans added up, the start not driven to when the robot never left it.
def task_program():
    here = get_current_location()
    results = []
    for room in [x for x in get_all_rooms() if x.split()[-1] == "office"]:
        go_to(room)
        if is_in_room("people"):
            results.append(ask("people", "Snack?", ["cupcake", "donut", "ham sandwich", "beef jerky"]) in {"ham sandwich", "beef jerky"})
    if get_current_location() != here:
        go_to(here)
    say("%d of the snacks that were chosen are savory." % sum(results))
