"""Judge a program in every world of a task, and explain its failures."""

from codebotler.rtl import explain
from roboeval import Completion, evaluate, load_suite
from roboeval.evaluation.runs.traces import trace_of

PROGRAM = """
def task_program():
    for room in get_all_rooms():
        if "lab" in room:
            go_to(room)
            say("Good day!")
"""

suite = load_suite("paper")
completion = Completion(task="SayGoodDay", prompt=0, index=0, program=PROGRAM)
(row,) = evaluate([completion], suite)

print("passed" if row["failure"] is None else f"failed: {row['failure']['kind']}")
for scenario, verdict in zip(suite.tasks["SayGoodDay"].scenarios, row["verdicts"], strict=True):
    print(f"- {verdict['world']}: {'satisfied' if verdict['satisfied'] else 'not satisfied'}")
    for requirement in scenario.require:
        if requirement.text in verdict["failed_checks"]:
            why = explain(requirement.formula, trace_of(verdict))
            print(f"    {requirement.text}: {why.sentence if why else ''}")
