"""What the best plan of a MISUS problem is worth at the most: OR-Tools CP-SAT on exported problems.

The model is compact. Each rover has a circuit through nodes (place, sol): an arc within a sol, or to a later
sol, is a drive made in the sol that it leads to. A goal is made by a rover in a sol in which the rover is
at its place. Time, energy and memory are linear in arcs and goals: the daily communication is the last of its
sol, so that order within a sol matters for nothing but the length of drives. Problems in which it does
(goals with windows, with requirements or for two rovers, a communication that may be made earlier) are
refused. See README.md.
"""

import argparse
import csv
import json
import math
import pathlib
import shlex
import subprocess
import sys
import tempfile

from ortools.sat.python import cp_model

from rcpsp_max import farside

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Weights are taken to so much.
GRAIN = 10_000


# What plans exported problems.
SOLVE = "cargo run --quiet --release -p farside-misus --example solve_problem --"


def said(command, *words):
    done = subprocess.run([*shlex.split(command), *map(str, words)], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr)
    return done.stdout


def refuse(problem):
    """Why the compact model is not one of this problem, if it is not."""
    for goal in problem["goals"]:
        for key in ("window_ms", "requires", "rovers"):
            if key in goal:
                return f"goal {goal['name']} has {key}"
    for activity in problem["activities"]:
        rover = next(r for r in problem["rovers"] if r["name"] == activity["rover"])
        opens, closes = activity["window_ms"]
        if closes != rover["sols"][activity["sol"]]["closes_ms"] or closes - opens != activity["duration_ms"]:
            return f"activity {activity['name']} need not be the last of its sol"
    return None


def drive_ms(rover, a, b):
    """As Farside has it: lengths to the millimetre, durations up to the millisecond."""
    length_mm = math.floor(1000 * math.hypot(a[0] - b[0], a[1] - b[1]) + 0.5)
    return -(-1000 * length_mm // rover["speed_mm_s"])


class Model:
    def __init__(self, problem):
        self.problem = problem
        self.model = cp_model.CpModel()
        self.places = sorted({tuple(goal["position_m"]) for goal in problem["goals"]})
        self.visits = {}  # (rover, place, sol)
        self.arcs = {}  # (rover, from node, to node); a node is (place, sol), None the start and the end
        self.made = {}  # (goal, rover, sol)
        for number in range(len(problem["rovers"])):
            self.add_rover(number)
        self.add_score()

    def add_rover(self, number):
        problem, model = self.problem, self.model
        rover = problem["rovers"][number]
        sols = range(len(rover["sols"]))
        nodes = [(place, sol) for sol in sols for place in range(len(self.places))]
        index = {node: at + 1 for at, node in enumerate(nodes)}
        index[None] = 0
        arcs = []
        drives = {sol: [] for sol in sols}

        def arc(a, b):
            literal = model.new_bool_var(f"{number} {a} {b}")
            self.arcs[number, a, b] = literal
            arcs.append((index[a], index[b], literal))
            if b is not None:
                start = rover["position_m"] if a is None else self.places[a[0]]
                drives[b[1]].append((drive_ms(rover, start, self.places[b[0]]), literal))

        arc(None, None)
        for node in nodes:
            visit = model.new_bool_var(f"{number} visits {node}")
            self.visits[number, *node] = visit
            arcs.append((index[node], index[node], ~visit))
            model.add_implication(visit, ~self.arcs[number, None, None])
            arc(None, node)
            arc(node, None)
            for other in nodes:
                if node != other and node[1] <= other[1]:
                    arc(node, other)
        model.add_circuit(arcs)
        stored = rover["stored_bits"]
        for sol in sols:
            stored = self.add_sol(number, sol, drives[sol], stored)

    def add_sol(self, number, sol, drives, stored):
        problem, model = self.problem, self.model
        rover = problem["rovers"][number]
        time = [(ms, literal) for ms, literal in drives]
        energy = [(ms * rover["drive_mw"], literal) for ms, literal in drives]
        memory = []
        for at, goal in enumerate(problem["goals"]):
            made = model.new_bool_var(f"{number} makes {goal['name']} in {sol}")
            self.made[at, number, sol] = made
            place = self.places.index(tuple(goal["position_m"]))
            model.add_implication(made, self.visits[number, place, sol])
            time.append((goal["duration_ms"], made))
            energy.append((goal["duration_ms"] * goal["power_mw"], made))
            memory.append((goal["memory_bits"], made))
        # Nobody goes where there is nothing to make: not needed, but it cuts.
        for place, position in enumerate(self.places):
            made = [
                self.made[at, number, sol]
                for at, goal in enumerate(problem["goals"])
                if tuple(goal["position_m"]) == position
            ]
            model.add(sum(made) >= self.visits[number, place, sol])
        activities = [
            a for a in problem["activities"] if a["rover"] == rover["name"] and a["sol"] == sol
        ]
        limits = rover["sols"][sol]
        length = limits["closes_ms"] - limits["opens_ms"] - sum(a["duration_ms"] for a in activities)
        has = limits["energy_uj"] - sum(a["duration_ms"] * a["power_mw"] for a in activities)
        model.add(sum(c * x for c, x in time) <= length)
        # In millijoules, rounded down, so that products stay small; a plan that has the energy has it still.
        model.add(sum(c // 1000 * x for c, x in energy) <= has // 1000)
        model.add(stored + sum(c * x for c, x in memory) <= rover["memory_bits"])
        left = model.new_int_var(0, rover["memory_bits"], f"{number} keeps after {sol}")
        sends = sum(a["sends_bits"] for a in activities)
        model.add(left >= stored + sum(c * x for c, x in memory) - sends)
        return left

    def add_score(self):
        problem, model = self.problem, self.model
        names = {goal["name"]: at for at, goal in enumerate(problem["goals"])}
        self.achieved = []
        terms = []
        for at, goal in enumerate(problem["goals"]):
            achieved = model.new_bool_var(goal["name"])
            model.add(sum(x for (g, _, _), x in self.made.items() if g == at) == achieved)
            if goal.get("mandatory"):
                model.add(achieved == 1)
            self.achieved.append(achieved)
            terms.append((goal["weight"], achieved))
        self.whole = []
        for combination in problem["combinations"]:
            members = [self.achieved[names[name]] for name in combination["goals"]]
            whole = model.new_bool_var("whole")
            for member in members:
                model.add_implication(whole, member)
            model.add_bool_or([whole, *(~member for member in members)])
            self.whole.append((whole, [names[name] for name in combination["goals"]]))
            terms.append((combination["weight"], whole))
        model.maximize(sum(round(GRAIN * weight) * x for weight, x in terms))

    def hint(self, plan):
        """Starts from a plan: goals, visits and arcs."""
        names = {goal["name"]: at for at, goal in enumerate(self.problem["goals"])}
        on = set()
        for number, stops in enumerate(plan):
            before = None
            for stop in stops:
                goal = names.get(stop["task"])
                if goal is None:
                    continue
                place = self.places.index(tuple(self.problem["goals"][goal]["position_m"]))
                node = (place, stop["sol"])
                on.update([("made", goal, number, stop["sol"]), ("visit", number, *node)])
                if node != before:
                    on.add(("arc", number, before, node))
                before = node
            on.add(("arc", number, before, None))
        done = {key[1] for key in on if key[0] == "made"}
        for kind, variables in (("made", self.made), ("visit", self.visits), ("arc", self.arcs)):
            for key, variable in variables.items():
                self.model.add_hint(variable, (kind, *key) in on)
        for at, achieved in enumerate(self.achieved):
            self.model.add_hint(achieved, at in done)
        for whole, members in self.whole:
            self.model.add_hint(whole, all(member in done for member in members))

    def solve(self, seconds, workers):
        solver = cp_model.CpSolver()
        solver.parameters.max_time_in_seconds = seconds
        solver.parameters.num_workers = workers
        solver.parameters.linearization_level = 2
        status = solver.solve(self.model)
        if status in (cp_model.INFEASIBLE, cp_model.MODEL_INVALID):
            sys.exit(f"{self.problem['name']}: {solver.status_name(status)}: a plan of nothing is one")
        best, bound = 0.0, math.inf
        if status != cp_model.UNKNOWN:
            best = solver.objective_value / GRAIN
        # Nothing is known before all is read in.
        if status != cp_model.UNKNOWN or solver.best_objective_bound > 0:
            bound = solver.best_objective_bound / GRAIN
        return best, bound, status == cp_model.OPTIMAL, solver.wall_time


def numbers(text):
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="*", help="exported problems; without, problems are drawn")
    parser.add_argument("--seeds", default="0-19", help="which problems are drawn, as 0-19")
    parser.add_argument("--rocks", type=int, help="of how many rocks; 10 to 30 unless given")
    parser.add_argument("--seconds", type=float, default=60, help="of CP-SAT for each problem")
    parser.add_argument("--workers", type=int, default=1, help="threads of CP-SAT")
    parser.add_argument("--operations", type=int, default=50_000_000, help="of the search by neighbourhoods")
    parser.add_argument("--hint", choices=["lns", "idgs", "none"], default="lns", help="where CP-SAT starts")
    parser.add_argument("--table", type=pathlib.Path, help="where bounds are written to; others there are kept")
    parser.add_argument("--farside", default=farside(), help="the command that exports problems")
    parser.add_argument("--solve", default=SOLVE, help="the command that plans them")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = options.files
        if not files:
            keys = [f"problem.rocks_{end}={options.rocks}" for end in ("least", "most") if options.rocks]
            sets = [word for key in keys for word in ("--set", key)]
            for seed in numbers(options.seeds):
                path = pathlib.Path(folder) / f"{seed}.json"
                said(options.farside, "problem", "misus/planners", "--seed", seed, "--out", path, *sets)
                files.append(str(path))
        paths = [str(pathlib.Path(file).resolve()) for file in files]
        lines = said(options.solve, *paths, "--operations", options.operations)
        compare(paths, [json.loads(line) for line in lines.splitlines()], options)


def enter(table, digest, bound, proven, name):
    """Adds a bound to a table, or takes it for a greater one."""
    rows = {}
    if table.exists():
        with table.open(newline="") as file:
            rows = {row["digest"]: row for row in csv.DictReader(file)}
    known = rows.get(digest)
    is_news = known is None or bound < float(known["bound"])
    if is_news or (proven and bound <= float(known["bound"])):
        rows[digest] = {"digest": digest, "bound": bound, "optimal": str(proven).lower(), "problem": name}
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, ["digest", "bound", "optimal", "problem"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows.values(), key=lambda row: row["digest"]))


def compare(paths, ours, options):
    print(f"{'problem':<24}{'idgs':>9}{'lns':>9}{'cp-sat':>9}{'bound':>9}  proven {'s':>6}")
    proven, wrong = [], 0
    for path, our in zip(paths, ours):
        problem = json.loads(pathlib.Path(path).read_text())
        if why := refuse(problem):
            sys.exit(f"{path}: {why}: the compact model is none of this problem")
        model = Model(problem)
        if options.hint != "none":
            model.hint(our[options.hint]["plan"])
        best, bound, optimal, seconds = model.solve(options.seconds, options.workers)
        idgs, lns = our["idgs"]["score"], our["lns"]["score"]
        print(
            f"{problem['name'][:23]:<24}{idgs:9.2f}{lns:9.2f}{best:9.2f}{bound:9.2f}"
            f"  {'yes' if optimal else 'no':<6} {seconds:6.1f}",
            flush=True,
        )
        if options.table and bound < math.inf:
            enter(options.table, our["digest"], bound, optimal, problem["name"])
        if max(idgs, lns) > bound + 1e-3:
            print(f"  a plan is worth more than the bound: {max(idgs, lns)}")
            wrong += 1
        proven.append((idgs, lns, max(best, lns, idgs), optimal, best))
    for name, rows in (("proven", [row for row in proven if row[3]]), ("all", proven)):
        if rows:
            shares = [[row[at] / row[2] for row in rows] for at in (0, 1)]
            mean = [sum(share) / len(rows) for share in shares]
            print(
                f"{name}: {len(rows)} problems; of the best known, idgs {mean[0]:.3f} in the mean, "
                f"{min(shares[0]):.3f} at worst; lns {mean[1]:.3f} in the mean, {min(shares[1]):.3f} at worst"
            )
    level = sum(row[1] >= row[4] - 1e-6 for row in proven)
    print(f"lns is at least as good as CP-SAT's plan on {level} of {len(proven)} problems")
    if wrong:
        sys.exit(1)


if __name__ == "__main__":
    main()
