"""The panes of the page, one a file: instruction, program, robot, its questions, past missions."""
