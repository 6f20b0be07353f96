"""Calls everything with stars and keywords that do not fit."""
# tame: yes
def own(a, /, b=1, *c, d=2, **e):
    return [a, b, c, d, e]

def task_program():
    say(str(own(*{1: 2}.items(), **{"a": 3, "x y": 4})) + str(own(*zip("ab", "cd"), d=0)))
    for number in range(9):
        try:
            if number == 0:
                own(*5)
            elif number == 1:
                own(**[])
            elif number == 2:
                own(1, **{1: 2})
            elif number == 3:
                say(*[])
            elif number == 4:
                say(text="x")
            elif number == 5:
                time.sleep(**{"seconds": 1})
            elif number == 6:
                time.time(*5)
            elif number == 7:
                ask("a", "b", "c")
            else:
                say(**5)
        except TypeError as error:
            say(str(error))
