"""Tries to keep what it saw in a global list, and to find it in the next world."""
# tame: yes
seen = []

def task_program():
    global seen
    seen += get_all_rooms()
    seen.append(seen)
    say(str(len(seen)) + str(seen))
