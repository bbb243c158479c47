"""What the best plan of a small MISUS problem is worth, by going through all sets of goals.

A program of its own, without a solver: for each rover, which sets of goals it can achieve in two sols; then which
sets several rovers can achieve together; then the set of these that is worth most by Equation 1. Drives through
places are the shortest (Held and Karp). The result is a bound, and the optimum if some plan is worth as much:

- a rover may pass a place of another rover's goal at the end of a sol, which plans may not;
- of memory it is asked that the first sol's goals, the second's and all together fit, not more.

Problems of up to 18 goals and two sols take a few seconds. Those for which the compact model of misus_bound.py is
none are refused, and those with weights below zero, for which a part of a set may be worth more than the set.
See README.md.
"""

import argparse
import json
import pathlib
import sys
import tempfile

import numpy as np

from misus_bound import SOLVE, drive_ms, enter, numbers, refuse, said
from rcpsp_max import farside

MOST_GOALS = 18


def close(sets, goals):
    """Makes every part of a set that is in the table one that is, too."""
    for goal in range(goals):
        table = sets.reshape(-1, 2, 1 << goal)
        table[:, 0] |= table[:, 1]
    return sets


def largest(sets, goals):
    """The sets of a closed table that are part of no other."""
    is_part = np.zeros_like(sets)
    for goal in range(goals):
        table, part = sets.reshape(-1, 2, 1 << goal), is_part.reshape(-1, 2, 1 << goal)
        part[:, 0] |= table[:, 1]
    return np.flatnonzero(sets & ~is_part)


def together(first, second, goals):
    """Every set of one table with every set of another, closed."""
    both = np.zeros(1 << goals, bool)
    few, many = sorted((largest(close(first, goals), goals), largest(close(second, goals), goals)), key=len)
    for one in few:
        both[many | one] = True
    return close(both, goals)


class Sums:
    """Of every set of goals: time, energy and memory, the places, and what it is worth."""

    def __init__(self, problem):
        goals = problem["goals"]
        self.goals = len(goals)
        self.places = sorted({tuple(goal["position_m"]) for goal in goals})
        sets = np.arange(1 << self.goals)
        names = {goal["name"]: at for at, goal in enumerate(goals)}

        def total(values):
            return sum(((sets >> at) & 1) * value for at, value in enumerate(values))

        self.ms = total([goal["duration_ms"] for goal in goals])
        self.uj = total([goal["duration_ms"] * goal["power_mw"] for goal in goals])
        self.bits = total([goal["memory_bits"] for goal in goals])
        self.at = np.zeros_like(sets)
        for number, goal in enumerate(goals):
            place = self.places.index(tuple(goal["position_m"]))
            self.at |= ((sets >> number) & 1) << place
        self.worth = total([goal["weight"] for goal in goals])
        for combination in problem["combinations"]:
            mask = sum(1 << names[name] for name in combination["goals"])
            self.worth = self.worth + combination["weight"] * ((sets & mask) == mask)


def shortest(first_ms, ms):
    """By set of places and last place: the least driving from where `first_ms` says how far each place is."""
    places = len(first_ms)
    least = np.full((1 << places, places), np.inf)
    for place in range(places):
        least[1 << place, place] = first_ms[place]
    for visited in range(1, 1 << places):
        for last in range(places):
            if least[visited, last] < np.inf:
                for after in range(places):
                    if not visited >> after & 1:
                        way = least[visited, last] + ms[last][after]
                        at = visited | 1 << after, after
                        least[at] = min(least[at], way)
    return least


def within(problem, sums, rover, sol, drive):
    """Which sets a rover can achieve in a sol, by how long it drives for each set."""
    limits = rover["sols"][sol]
    activities = [a for a in problem["activities"] if a["rover"] == rover["name"] and a["sol"] == sol]
    has_ms = limits["closes_ms"] - limits["opens_ms"] - sum(a["duration_ms"] for a in activities)
    has_uj = limits["energy_uj"] - sum(a["duration_ms"] * a["power_mw"] for a in activities)
    return (
        (sums.ms + drive <= has_ms)
        & (sums.uj + drive * rover["drive_mw"] <= has_uj)
        & (sums.bits <= rover["memory_bits"])
    )


def one_rover(problem, sums, rover):
    """The sets that a rover can achieve."""
    places = range(len(sums.places))
    ms = [[drive_ms(rover, a, b) for b in sums.places] for a in sums.places]
    start_ms = [drive_ms(rover, rover["position_m"], place) for place in sums.places]
    first = shortest(start_ms, ms)
    least = first.min(axis=1)
    least[0] = 0
    # With nothing in the first sol, or nothing in the second.
    found = within(problem, sums, rover, 0, least[sums.at]) | within(problem, sums, rover, 1, least[sums.at])
    for last in places:
        morning = within(problem, sums, rover, 0, first[:, last][sums.at])
        on = shortest(ms[last], ms).min(axis=1)
        on[0] = 0
        evening = within(problem, sums, rover, 1, on[sums.at])
        found |= together(morning, evening, sums.goals)
    sends = sum(a["sends_bits"] for a in problem["activities"] if a["rover"] == rover["name"] and a["sol"] == 0)
    return close(found, sums.goals) & (sums.bits <= rover["memory_bits"] + sends)


def bound(problem):
    """What the best plan is worth at the most."""
    sums = Sums(problem)
    sets = None
    for rover in problem["rovers"]:
        his = one_rover(problem, sums, rover)
        sets = his if sets is None else together(sets, his, sums.goals)
    return float(sums.worth[sets].max())


def refuses(problem):
    """Why a problem is none for this program, if it is not."""
    weights = [one["weight"] for one in problem["goals"] + problem["combinations"]]
    if any(weight < 0 for weight in weights):
        return "a weight is below zero"
    if len(problem["goals"]) > MOST_GOALS:
        return f"{len(problem['goals'])} goals, expected {MOST_GOALS} at the most"
    if any(len(rover["sols"]) != 2 or rover["stored_bits"] for rover in problem["rovers"]):
        return "expected two sols, and nothing stored at first"
    if any(goal.get("mandatory") for goal in problem["goals"]):
        return "a goal is mandatory"
    return refuse(problem)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="*", help="exported problems; without, problems of 6 rocks are drawn")
    parser.add_argument("--seeds", default="0-19", help="which problems are drawn, as 0-19")
    parser.add_argument("--operations", type=int, default=20_000_000, help="of the search by neighbourhoods")
    parser.add_argument("--table", type=pathlib.Path, help="where bounds are written to; others there are kept")
    parser.add_argument("--farside", default=farside(), help="the command that exports problems")
    parser.add_argument("--solve", default=SOLVE, help="the command that plans them")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = options.files
        if not files:
            six = [word for end in ("least", "most") for word in ("--set", f"problem.rocks_{end}=6")]
            for seed in numbers(options.seeds):
                path = pathlib.Path(folder) / f"{seed}.json"
                said(options.farside, "problem", "misus/planners", "--seed", seed, "--out", path, *six)
                files.append(str(path))
        paths = [str(pathlib.Path(file).resolve()) for file in files]
        lines = said(options.solve, *paths, "--operations", options.operations)
        ours = [json.loads(line) for line in lines.splitlines()]
        compare([json.loads(pathlib.Path(path).read_text()) for path in paths], ours, options)


def compare(problems, ours, options):
    print(f"{'problem':<24}{'idgs':>9}{'lns':>9}{'bound':>9}  proven")
    wrong = 0
    for problem, our in zip(problems, ours):
        if why := refuses(problem):
            sys.exit(f"{problem['name']}: {why}")
        most, idgs, lns = bound(problem), our["idgs"]["score"], our["lns"]["score"]
        proven = max(idgs, lns) >= most - 1e-6
        print(f"{problem['name'][:23]:<24}{idgs:9.2f}{lns:9.2f}{most:9.2f}  {'yes' if proven else 'no'}", flush=True)
        if options.table:
            enter(options.table, our["digest"], most, proven, problem["name"])
        wrong += max(idgs, lns) > most + 1e-6
    if wrong:
        sys.exit(f"{wrong} plans are worth more than the bound")


if __name__ == "__main__":
    main()
