# Tells who gave mail, and puts the bin down after that.
def task_program():
    go_to("the mail room")
    pick("the bin")
    gave_mail = []
    offices = list(filter(lambda r: "office" in r, get_all_rooms()))
    while offices:
        office = offices.pop(0)
        go_to(office)
        if is_in_room("someone"):
            if ask("someone", "Any mail to send?", ["yes", "no"]) != "no":
                say("Then put it into the bin, please.")
                gave_mail.append(office.partition("'")[0])
    go_to("the mail room")
    if gave_mail:
        say("These people gave mail: " + ", ".join(gave_mail))
    else:
        say("None of them gave mail.")
    place("the bin")
