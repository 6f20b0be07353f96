# The offices from the last to the first, the count in words with its own singular.
def task_program():
    words = ["nobody", "one person", "two people", "three people", "four people", "five people",
             "six people", "seven people", "eight people", "nine people", "ten people"]
    home = get_current_location()
    count = 0
    offices = [room for room in get_all_rooms() if room.endswith("office")]
    for office in reversed(offices):
        go_to(office)
        if not is_in_room("someone"):
            continue
        answer = ask("someone", "Hello! Would you rather have a donut, beef jerky, a cupcake or a ham sandwich?",
                     ["a donut", "beef jerky", "a cupcake", "a ham sandwich"])
        if answer in ("beef jerky", "a ham sandwich"):
            count = count + 1
    go_to(home)
    amount = words[count] if count < len(words) else str(count) + " people"
    say("Of the people in the offices, " + amount + " picked a savory snack.")
