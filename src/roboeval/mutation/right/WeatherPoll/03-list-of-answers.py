# A list of answers, the share computed at the end.
import time


def task_program():
    origin = get_current_location()
    go_to("main entrance")
    answers = []
    while len(answers) < 10:
        if not is_in_room("person"):
            time.sleep(10)
            continue
        answers.append(ask("person", "Excuse me, do you think that it is hot outside?", ["no", "yes"]))
    go_to(origin)
    share = 100 * answers.count("yes") // len(answers)
    say("The percentage of yes is " + str(share) + "%.")
