# A poll is an object.
class Poll:
    def __init__(self, question, options):
        self.question = question
        self.votes = {option: 0 for option in options}

    def hold(self):
        if is_in_room("people"):
            self.votes[ask("people", self.question, list(self.votes))] += 1

    def result(self):
        return " and ".join(f"{n} of {option}" for option, n in self.votes.items())


def task_program():
    back = get_current_location()
    poll = Poll("Hello! For Halloween, which one would you like?", ["caramel", "gummy", "chocolate"])
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            poll.hold()
    go_to(back)
    say("You need " + poll.result() + ".")
