"""Tries to change options after they were offered, through the chosen object itself."""
# tame: yes
def task_program():
    go_to("kitchen")
    options = [["yes"], ["no"]]
    try:
        chosen = ask("", "Is it yes?", options)
        chosen.append("or no")
        say(str(options))
    except Exception as error:
        say(repr(error))
