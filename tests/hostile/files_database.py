"""Tries to make a database."""
# ends: python-error ModuleNotFoundError


def task_program():
    import sqlite3

    sqlite3.connect("@CANARY_FOLDER@/database").execute("create table t (x)")
