# A messenger is an object.
class Messenger:
    def visit(self, name):
        self.name = name
        go_to(name + "'s office")

    def question(self, text, *options):
        return ask(self.name, text, list(options))

    def message(self, text):
        say(self.name + ", " + text)


def task_program():
    robot = Messenger()
    robot.visit("Sally")
    agreed = robot.question("Would you like to see a movie with Mark?", "yes", "no") == "yes"
    robot.visit("Mark")
    if not agreed:
        robot.message("Sally does not want to see a movie with you.")
        return
    robot.message("Sally wants to see a movie with you.")
    hour = robot.question("When would you like to go there?", "4 pm", "5 pm", "6 pm")
    robot.visit("Sally")
    robot.message("Mark would like to go at " + hour + ".")
