"""Uses slices as keys, which some versions of Python can hash."""
# tame: yes
def task_program():
    known = {}
    known[1:2] = 3
    known[1:, ::2] = 4
    say(str(known))
