"""A real rosmaster that ends when its input does, so that none is ever left behind."""

import os
import sys

import rosmaster.master

master = rosmaster.master.Master(int(sys.argv[1]))
master.start()
print('["ready"]', flush=True)
sys.stdin.read()
os._exit(0)
