# Fetch, collect, return: three functions.
BIN = "mail bin"


def fetch_bin():
    go_to("mail room")
    pick(BIN)


def collect():
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("anybody"):
                if ask("anybody", "Have you got mail to send?", ["yes", "no"]) == "yes":
                    say("Please put your mail into the bin that I am holding.")
                    yield room.split("'")[0].capitalize()


def return_bin():
    go_to("mail room")
    place(BIN)


def task_program():
    fetch_bin()
    people = list(collect())
    return_bin()
    if len(people) == 0:
        say("Nobody has given mail.")
    elif len(people) == 1:
        say("Only " + people[0] + " has given mail.")
    else:
        say(", ".join(people[:-1]) + " and " + people[-1] + " have given mail.")
