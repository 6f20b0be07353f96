"""Formats by all the ways that there are, with widths and signs that depend on the locale."""
# tame: yes
def task_program():
    number = 1234567.891
    say(f"{number:n} {number:,} {number:_} {number:+.3e} {number!r:>{20}} {[1]!s:^9}")
    say("{:n} {!a:>5} {{}} {:%}".format(1e6, "é", 0.5))
    say("%*d|%-5s|%(x)s" % (5, 1, 2) if False else "%*d|%-5s|%r" % (5, 1, 2, [3]))
    say("%(a)r %(a)s" % {"a": {"b": float("inf")}})
    f"{[]:x}"
