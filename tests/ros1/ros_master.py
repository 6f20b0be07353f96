"""A real rosmaster that ends when its input does, so that none is ever left behind."""

import sys
import time

import rosmaster.master

master = rosmaster.master.Master(int(sys.argv[1]))
master.start()
print('["ready"]', flush=True)
sys.stdin.read()
master.stop()
time.sleep(0.05)
