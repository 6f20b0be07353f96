# A letter box of its own class.
class Bin:
    def __init__(self, name, home):
        self.name, self.home, self.givers = name, home, []

    def __enter__(self):
        go_to(self.home)
        pick(self.name)
        return self

    def __exit__(self, *_):
        go_to(self.home)
        place(self.name)

    def offer(self, who):
        if ask("person", "Do you have something to mail?", ["Yes", "No"]) == "Yes":
            ask("person", "Please put it into the mail bin.", ["Yes, I did"])
            self.givers.append(who)


def task_program():
    with Bin("mail bin", "mail room") as mail:
        for room in get_all_rooms():
            if "office" in room:
                go_to(room)
                if is_in_room("person"):
                    mail.offer(room.split("'")[0].capitalize())
    say("Mail came from " + ", ".join(mail.givers) + "." if mail.givers else "No mail came.")
