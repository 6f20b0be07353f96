# Totals up to twenty in words, above that in digits.
NUMBERS = ("zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen "
           "sixteen seventeen eighteen nineteen twenty").split()


def spell(n):
    return NUMBERS[n] if n <= 20 else str(n)


def task_program():
    here = get_current_location()
    c = k = g = 0
    for r in get_all_rooms():
        if "office" in r:
            go_to(r)
            if is_in_room("person"):
                c += int(ask("person", "How many chocolates do you wish?", ["0", "1", "2", "3", "4"]))
                k += int(ask("person", "How many caramels do you wish?", ["0", "1", "2", "3", "4"]))
                g += int(ask("person", "How many gummy bears do you wish?", ["0", "1", "2", "3", "4"]))
    go_to(here)
    say(f"The totals are {spell(c)} for chocolate, {spell(k)} for caramel and {spell(g)} for gummy.")
