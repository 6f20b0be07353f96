# A Counter of all snacks, the two savory ones added up.
from collections import Counter


def task_program():
    begin = get_current_location()
    menu = ["cupcake", "donut", "ham sandwich", "beef jerky"]
    tally = Counter()
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("human"):
                say("Hi there!")
                tally[ask("human", "What is your pick?", menu)] += 1
    go_to(begin)
    savory = tally["ham sandwich"] + tally["beef jerky"]
    if savory == 1:
        say("1 person went for something savory.")
    else:
        say(f"{savory} persons went for something savory.")
