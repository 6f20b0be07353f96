# A guest is a dataclass.
from dataclasses import dataclass


@dataclass
class Guest:
    name: str
    joins: bool = False

    def invite(self):
        go_to(f"{self.name}'s office")
        self.joins = ask(self.name, f"{self.name}, would you like to have lunch?", ["Yes", "No"]) == "Yes"
        if self.joins:
            say("See you in the lobby in 5 minutes.")


def task_program():
    start = get_current_location()
    guests = [Guest("Alice"), Guest("Bob")]
    for guest in guests:
        guest.invite()
    go_to(start)
    joining = [guest.name for guest in guests if guest.joins]
    if len(joining) == 2:
        say("Both " + joining[0] + " and " + joining[1] + " are coming to lunch.")
    elif joining:
        say("Only " + joining[0] + " is coming to lunch.")
    else:
        say("Nobody is coming to lunch.")
