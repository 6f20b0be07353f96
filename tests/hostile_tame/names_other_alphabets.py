"""Writes names in letters that Python takes for others."""
# tame: yes
def task_program():
    ｘ = [3, 1, 2]
    x.ｓｏｒｔ()
    ſ = ﬁnd = 1
    say(str(x) + str(s) + str(find) + str(ｌｅｎ(x)))
