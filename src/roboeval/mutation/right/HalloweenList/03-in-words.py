# Numbers in words, with the right plural.
WORDS = ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]


def amount(n, one, many):
    number = WORDS[n] if n < len(WORDS) else str(n)
    return f"{number} {one if n == 1 else many}"


def task_program():
    me = get_current_location()
    chocolate = caramel = gummy = 0
    for room in get_all_rooms():
        if "office" not in room:
            continue
        go_to(room)
        if not is_in_room("person"):
            continue
        answer = ask("person", "Which one do you prefer for Halloween, a chocolate, a caramel or a gummy?",
                     ["a chocolate", "a caramel", "a gummy"])
        if answer == "a chocolate":
            chocolate += 1
        elif answer == "a caramel":
            caramel += 1
        else:
            gummy += 1
    go_to(me)
    say("We have to get " + amount(chocolate, "chocolate", "chocolates") + ", "
        + amount(caramel, "caramel", "caramels") + " and " + amount(gummy, "gummy", "gummies") + ".")
