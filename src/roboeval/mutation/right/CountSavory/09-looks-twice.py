# Looks a second time before it believes that an office is empty.
import time


def somebody_here():
    if is_in_room("person"):
        return True
    time.sleep(2)
    return is_in_room("person")


def task_program():
    origin = get_current_location()
    savory_count = 0
    for room in get_all_rooms():
        if "office" not in room:
            continue
        go_to(room)
        if somebody_here():
            wish = ask("person", "Would you like a ham sandwich, a cupcake, beef jerky or a donut?",
                       ["a ham sandwich", "a cupcake", "some beef jerky", "a donut"])
            if "ham" in wish or "beef" in wish:
                savory_count += 1
    go_to(origin)
    say("Hello again. " + str(savory_count) + " people would take a savory snack.")
