# The options are words, the totals digits.
VALUE = {"zero": 0, "one": 1, "two": 2, "three": 3, "four": 4}


def task_program():
    me = get_current_location()
    sums = [0, 0, 0]
    for room in reversed([r for r in get_all_rooms() if r.endswith("office")]):
        go_to(room)
        if is_in_room("person"):
            for i, candy in enumerate(["chocolates", "caramels", "gummies"]):
                sums[i] += VALUE[ask("person", "Hello! How many " + candy + " do you want for Halloween?", list(VALUE))]
    go_to(me)
    say("Altogether we need " + str(sums[0]) + " chocolates, " + str(sums[1]) + " caramels, and " + str(sums[2]) + " gummies.")
