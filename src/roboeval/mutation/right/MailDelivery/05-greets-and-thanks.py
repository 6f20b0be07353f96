# Greets, thanks, and says goodbye.
def task_program():
    go_to("mail room")
    pick("bin")
    have_mail = {}
    for room in sorted(get_all_rooms()):
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                say("Good day!")
                mail = ask("person", "Do you have mail for me?", ["Yes, I have", "No, nothing today"])
                have_mail[room] = mail.startswith("Yes")
                if have_mail[room]:
                    ask("person", "Could you put it in the bin, please?", ["OK"])
                    say("Thank you!")
                say("Goodbye!")
    go_to("mail room")
    place("bin")
    listed = [room.split("'s")[0] for room in have_mail if have_mail[room]]
    say("I have mail from: " + (", ".join(listed) if listed else "nobody"))
