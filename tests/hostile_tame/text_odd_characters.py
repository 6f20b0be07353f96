"""Says all that is odd in JSON, in terminals and at the ends of a string."""
# tame: yes
def task_program():
    say("\x00\x1b[31m\u2028\u2029\x7f\x80\uffff\U0010ffff \"\\/\b\f\n\r\t")
    say("\u00a0\u3000x\u2003")
    say("")
    is_in_room("\x00.*")
    go_to("kitchen\n")
