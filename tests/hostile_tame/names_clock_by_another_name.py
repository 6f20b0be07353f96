"""Imports the clock by another name."""
# tame: no
import time as clock

def task_program():
    say(str(clock))
