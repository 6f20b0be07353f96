"""A real rosmaster that ends with its input, so that no test leaves it running."""

import os
import sys

import rosmaster.master

master = rosmaster.master.Master(int(sys.argv[1]))
master.start()
print('["ready"]', flush=True)
sys.stdin.read()
os._exit(0)
