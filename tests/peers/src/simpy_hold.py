"""The hold model in SimPy: a timeout for each event, whose callback passes the job on.

    simpy_hold.py ACTORS POPULATION EVENTS

Prints how many nanoseconds an event took, between a fifth of EVENTS and all of them.
"""

import random
import sys
import time

import simpy

LOOK_AHEAD_NS = 100_000_000
MEAN_NS = 900_000_000.0


class Enough(Exception):
    """Enough events were handled."""


class Holder:
    def __init__(self, env, at, holders):
        self.env = env
        self.holders = holders
        self.stream = random.Random(at)

    def start(self, population):
        for number in range(population):
            self.send((number, 0, 0))

    def send(self, job):
        to = self.holders[int(self.stream.random() * len(self.holders))]
        delay = LOOK_AHEAD_NS + int(self.stream.expovariate(1.0) * MEAN_NS)
        self.env.timeout(delay, job).callbacks.append(to.receive)

    def receive(self, event):
        count()
        number, hops, payload = event.value
        self.send((number, hops + 1, payload))


actors, population, events = map(int, sys.argv[1:4])
handled = 0
begin = None


def count():
    global handled, begin
    handled += 1
    if handled == events // 5:
        begin = time.perf_counter()
    if handled == events:
        print((time.perf_counter() - begin) * 1e9 / (events - events // 5))
        raise Enough


env = simpy.Environment()
holders = []
holders.extend(Holder(env, at, holders) for at in range(actors))
for holder in holders:
    holder.start(population)
try:
    env.run()
except Enough:
    pass
