"""Tries to leave generators in the middle of what they do."""
# tame: yes
def told(text):
    say(text)
    return text

def task_program():
    for room in (told(room) for room in get_all_rooms()):
        break
    say(str(next(told(room) for room in get_all_rooms())))
    say(str(any(told(room) for room in get_all_rooms())))
    next(told(room) for room in get_all_rooms() if room == "nowhere")
