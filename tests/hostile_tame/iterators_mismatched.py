"""Gives iterators to builtins that cannot use them, and shows what they say."""
# tame: yes
def task_program():
    known = {1: 2}
    tried = 0
    while tried < 6:
        tried += 1
        try:
            if tried == 1:
                len(x for x in [1])
            elif tried == 2:
                next(known.items())
            elif tried == 3:
                list(reversed(zip([1])))
            elif tried == 4:
                list(enumerate([1], map(abs, [1])))
            elif tried == 5:
                dict(x for x in [1])
            else:
                "".join(x for x in [1])
        except TypeError as error:
            say(str(error))
