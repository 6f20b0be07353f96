"""Use RTL on its own: test a formula on a hand-written trace, and explain the result."""

from codebotler.core.trace import Event, Option
from codebotler.rtl import explain, holds, parse

lunch = parse("""tr.AfterFirst(goto("alice's office")).AfterFirst(ask("lunch", ".*")).Exists(say("lobby"))""")
trace = (
    Event("goto", "alice's office"),
    Event("ask", "Would you like to have lunch?", (Option("yes"), Option("no")), answer="yes"),
    Event("say", "See you in the kitchen!"),
)

print(holds(lunch, trace))
why = explain(lunch, trace)
print(why.sentence if why else "it holds")
