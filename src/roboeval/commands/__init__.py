"""The commands of RoboEval; what a command needs is imported when it runs, so that help is quick."""
