# What to tell him stands in a dictionary.
MESSAGES = {
    "yes": "Sally accepts, she will go to the movies with you.",
    "no": "Sally declines, she will not go to the movies with you.",
}


def task_program():
    sally, mark = "Sally's office", "Mark's office"
    go_to(sally)
    answer = ask("Sally", "Will you go to the movies with Mark?", list(MESSAGES))
    go_to(mark)
    say(MESSAGES[answer])
    if answer == "no":
        return
    times = [f"{hour} pm" for hour in (4, 5, 6)]
    picked = ask("Mark", "Please choose a time to leave.", times)
    go_to(sally)
    say(f"The time to leave is {picked}.")
