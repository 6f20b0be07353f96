# A Counter, asked for its kinds at the end.
from collections import Counter


def task_program():
    start = get_current_location()
    offices = [r for r in get_all_rooms() if "office" in r]
    tally = Counter()
    for office in offices:
        go_to(office)
        if is_in_room("anybody"):
            say("Happy Halloween!")
            tally[ask("anybody", "What candy would you like?", ["Chocolate", "Caramel", "Gummy"])] += 1
    go_to(start)
    say(f"Chocolate: {tally['Chocolate']}, caramel: {tally['Caramel']}, gummy: {tally['Gummy']}.")
