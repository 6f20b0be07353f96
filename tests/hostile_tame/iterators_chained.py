"""Compares iterators with each other in chains of `in`, where one is searched and then looked for."""
# tame: yes
def task_program():
    known = {1: 2}
    say(str(1 in known.keys() in (x for x in [1])) + str(1 in (x for x in [1]) in known.values()))
    say(str(2 in known.values() == 1) + str(1 in map(abs, [1]) is None) + str(3 in zip([3]) in [3]))
    1 in (x for x in [1]) < 2
