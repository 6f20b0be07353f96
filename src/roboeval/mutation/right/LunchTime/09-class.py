# The answer is an object.
class Answer:
    def __init__(self):
        self.agreed = False
        self.time = None

    def __str__(self):
        if not self.agreed:
            return "Jill does not want to have lunch."
        return f"Jill wants to have lunch, at {self.time}."


def task_program():
    start = get_current_location()
    answer = Answer()
    go_to("Jill's office")
    answer.agreed = ask("Jill", "Would you like to have lunch today?", ["Yes", "No"]) == "Yes"
    if answer.agreed:
        answer.time = ask("Jill", "What would be a good time?", [f"{hour}:00" for hour in range(11, 14)])
    go_to(start)
    say(str(answer))
