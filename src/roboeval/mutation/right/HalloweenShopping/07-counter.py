# A Counter that is updated.
from collections import Counter


def task_program():
    start = get_current_location()
    counter = Counter(chocolates=0, caramels=0, gummies=0)
    for room in [room for room in get_all_rooms() if "office" in room]:
        go_to(room)
        if is_in_room("anybody"):
            for sort in ["caramels", "gummies", "chocolates"]:
                counter[sort] += int(ask("anybody", f"Please choose the number of {sort} that you want.", ["0", "1", "2", "3", "4"]))
    go_to(start)
    say(", ".join(f"{number} {sort}" for sort, number in counter.items()) + ".")
