"""Makes a number of a kind that it cannot write."""
# tame: yes
def task_program():
    root = (-8) ** (1 / 3)
    say(str(root) + repr(abs(root)) + str(root == root))
    sorted([root, root])
