"""Tries to keep a list from world to world in a default argument."""
# tame: yes
def remembered(text, kept=[]):
    kept.append(text)
    return kept

def task_program(kept={}):
    kept[get_current_location()] = len(kept)
    say(str(remembered("a")) + str(remembered("b")) + str(kept))
