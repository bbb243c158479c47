"""RCPSP/max instances, their proven optima, and how near to them Farside's planners come.

    python rcpsp_max.py                 solves all instances with Farside, beside CP-SAT's answers
    python rcpsp_max.py generate        writes the instances, and CP-SAT's answers to them
    python rcpsp_max.py generate --check    says whether they are what it would write

An instance has n activities of fixed durations on five renewable resources, with minimal and
maximal lags between starts, as ProGen/max makes them (C. Schwindt, "ProGen/max: a new problem
generator for different resource-constrained project scheduling problems with minimal and maximal
time lags", Report WIOR-449, 1995). It is written in that program's `.sch` format. All have a
schedule without the resources; about a third have none with them.

CP-SAT decides each instance and proves its optimum. Where Farside says that an instance has no
schedule, it names activities without which it has one: CP-SAT checks that as well.
"""

import argparse
import csv
import json
import pathlib
import random
import shlex
import shutil
import subprocess
import sys

from ortools.sat.python import cp_model

MODELS = pathlib.Path(__file__).resolve().parents[2] / "actors" / "planning" / "models"
FOLDER = MODELS / "rcpsp_max"
ANSWERS = "answers.csv"
SIZES = (10, 20)
COUNT = 30
RESOURCES = 5
CAPACITY = 10
COLUMNS = ["file", "activities", "feasible", "makespan", "starts"]


class Project:
    """Activities 0 to n + 1, of which the first and the last are the project's start and end."""

    def __init__(self, durations, demands, capacities, lags):
        self.durations = durations
        self.demands = demands
        self.capacities = capacities
        # (from, to, lag): `to` starts at least `lag` after `from`.
        self.lags = lags

    @property
    def end(self):
        return len(self.durations) - 1

    def text(self):
        """The project in ProGen/max's format."""
        rows = [[self.end - 1, len(self.capacities), 0, 0]]
        for activity in range(self.end + 1):
            after = [(to, lag) for start, to, lag in self.lags if start == activity]
            successors = [to for to, _ in after]
            rows.append([activity, 1, len(after), *successors, *(f"[{lag}]" for _, lag in after)])
        for activity in range(self.end + 1):
            rows.append([activity, 1, self.durations[activity], *self.demands[activity]])
        rows.append(self.capacities)
        return "".join("\t".join(map(str, row)) + "\n" for row in rows)

    @staticmethod
    def read(text):
        """The project of a text that `text` wrote, or ProGen/max."""
        rows = [line.split() for line in text.splitlines() if line.strip()]
        last = int(rows[0][0]) + 1
        lags = []
        for activity, row in enumerate(rows[1 : last + 2]):
            count = int(row[2])
            for to, lag in zip(row[3 : 3 + count], row[3 + count :]):
                lags.append((activity, int(to), int(lag.strip("[]"))))
        durations, demands = [], []
        for row in rows[last + 2 : 2 * last + 3]:
            durations.append(int(row[2]))
            demands.append([int(word) for word in row[3:]])
        return Project(durations, demands, [int(word) for word in rows[2 * last + 3]], lags)


def longest_paths(count, lags):
    """By pair of activities, by how much the second starts after the first at least; None if there
    is a cycle that no schedule satisfies."""
    none = float("-inf")
    far = [[none] * count for _ in range(count)]
    for i in range(count):
        far[i][i] = 0
    for i, j, lag in lags:
        far[i][j] = max(far[i][j], lag)
    for k in range(count):
        for i in range(count):
            if far[i][k] == none:
                continue
            for j in range(count):
                far[i][j] = max(far[i][j], far[i][k] + far[k][j])
    return far if all(far[i][i] == 0 for i in range(count)) else None


def generated(size, seed):
    """An instance: the same for the same size and seed, on any machine."""
    rng = random.Random(1_000 * size + seed)

    def within(low, high):
        # Not `randint`: how that uses the generator is not promised.
        return low + int(rng.random() * (high - low + 1))

    end = size + 1
    durations = [0] + [within(1, 10) for _ in range(size)] + [0]
    demands = [[0] * RESOURCES for _ in range(end + 1)]
    factor = 0.5 + 0.5 * rng.random()
    for activity in range(1, end):
        for resource in range(RESOURCES):
            if rng.random() < factor:
                demands[activity][resource] = within(1, CAPACITY)
    lags = []
    for activity in range(1, end):
        # Successors are near: there are chains, and not everything follows the first ones.
        for to in range(activity + 1, min(activity + 6, end)):
            if rng.random() < 0.25:
                lags.append((activity, to, within(1, 2 * durations[activity] + 4)))
    # Maximal lags close cycles: `to` starts at most so long after what it follows. The less room
    # they leave beyond the longest path, the fewer of them the resources can keep.
    paths = longest_paths(end + 1, lags)
    pairs = [(i, j) for i in range(1, end) for j in range(1, end) if i != j and paths[i][j] > 0]
    for _ in range(within(size // 5, size // 3)):
        if not pairs:
            break
        activity, to = pairs[within(0, len(pairs) - 1)]
        lag = (to, activity, -(paths[activity][to] + within(0, size)))
        # Two of them may leave no schedule even without the resources.
        if longest_paths(end + 1, [*lags, lag]) is not None:
            lags.append(lag)
    has_before = {to for _, to, lag in lags if lag >= 0}
    has_after = {start for start, _, lag in lags if lag >= 0}
    first = [(0, to, 0) for to in range(1, end) if to not in has_before]
    # Ends are those of activities, also of ones that last longer than what follows them.
    last = [(at, end, durations[at]) for at in range(1, end) if at not in has_after]
    return Project(durations, demands, [CAPACITY] * RESOURCES, first + lags + last)


def proven(project, without=(), shortest=True):
    """CP-SAT's answer, proven: the starts of a shortest schedule, or of any, or None if there is
    none. What is in `without` does not take place, and no lag from or to it counts."""
    model = cp_model.CpModel()
    horizon = sum(
        max([duration, *(lag for start, _, lag in project.lags if start == activity)])
        for activity, duration in enumerate(project.durations)
    )
    activities = [at for at in range(project.end + 1) if at not in without]
    starts = {at: model.new_int_var(0, horizon, f"start_{at}") for at in activities}
    model.add(starts[0] == 0)
    for start, to, lag in project.lags:
        if start in starts and to in starts:
            model.add(starts[to] >= starts[start] + lag)
    intervals = {
        at: model.new_fixed_size_interval_var(starts[at], project.durations[at], f"activity_{at}")
        for at in activities
    }
    for resource, capacity in enumerate(project.capacities):
        demands = [project.demands[at][resource] for at in activities]
        model.add_cumulative([intervals[at] for at in activities], demands, capacity)
    makespan = model.new_int_var(0, horizon, "makespan")
    for at in activities:
        model.add(makespan >= starts[at] + project.durations[at])
    if shortest:
        model.minimize(makespan)
    solver = cp_model.CpSolver()
    # One worker, so that the schedule is the same in each run, as the optimum is anyway.
    solver.parameters.num_workers = 1
    solver.parameters.random_seed = 1
    status = solver.solve(model)
    if status == cp_model.INFEASIBLE:
        return None
    assert status in (cp_model.OPTIMAL, cp_model.FEASIBLE), solver.status_name(status)
    assert status == cp_model.OPTIMAL or not shortest
    return [solver.value(starts[at]) if at in starts else None for at in range(project.end + 1)]


def makespan_of(project, starts):
    return max(start + duration for start, duration in zip(starts, project.durations))


def instances():
    """File names and projects."""
    for size in SIZES:
        for seed in range(COUNT):
            yield f"n{size}_{seed + 1:02}.sch", generated(size, seed)


def generate(folder, check):
    """Writes the instances and their answers; or only compares."""
    rows = []
    differing = []
    folder.mkdir(parents=True, exist_ok=True)
    for name, project in instances():
        text, path = project.text(), folder / name
        if not check:
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            differing.append(name)
        starts = proven(project)
        feasible = starts is not None
        makespan = makespan_of(project, starts) if feasible else ""
        times = " ".join(map(str, starts)) if feasible else ""
        rows.append([name, project.end - 1, int(feasible), makespan, times])
    if check:
        kept = list(csv.reader((folder / ANSWERS).open()))[1:]
        # Of several shortest schedules another version may find another.
        for one, other in zip(rows, kept, strict=True):
            if list(map(str, one[:4])) != other[:4]:
                differing.append(one[0])
        print("differing:", ", ".join(differing) if differing else "none")
        return int(bool(differing))
    with (folder / ANSWERS).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    infeasible = sum(row[2] == 0 for row in rows)
    print(f"{len(rows)} instances in {folder}, {infeasible} of them without a schedule")
    return 0


def farside():
    """The command that is installed, else the one that was built here, else what builds it."""
    root = pathlib.Path(__file__).resolve().parents[2]
    built = root / "target" / "release" / "farside"
    if shutil.which("farside"):
        return "farside"
    if built.exists():
        return shlex.quote(str(built))
    manifest = shlex.quote(str(root / "Cargo.toml"))
    return f"cargo run --release --quiet --manifest-path {manifest} --"


def asked(command, path):
    """What Farside says of a file."""
    words = [word.replace("{file}", str(path)) for word in shlex.split(command)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    # Exit 1 is an answer as well: that there is no plan, and why.
    if done.returncode not in (0, 1):
        sys.exit(f"{' '.join(words)}\nends with {done.returncode}: {done.stderr.strip()}")
    try:
        return json.loads(done.stdout)
    except json.JSONDecodeError as error:
        sys.exit(f"{' '.join(words)}\nwrites no JSON: {error}")


def named(answer):
    """The activities that an explanation names."""
    goals = (answer.get("explanation") or {}).get("goals", [])
    return {int(goal.rpartition("_")[2]) for goal in goals if goal.startswith("activity_")}


def compare(folder, command):
    """Prints the table; 1 if Farside says what CP-SAT disproves."""
    with (folder / ANSWERS).open() as file:
        answers = list(csv.DictReader(file))
    wrong, per_size = [], {}
    head = f"{'instance':<12} {'CP-SAT':>8} {'Farside':>8} {'gap':>8} {'operations':>11}  note"
    print(head)
    print("-" * len(head))
    for row in answers:
        path, feasible = folder / row["file"], row["feasible"] == "1"
        answer = asked(command, path)
        found, note, gap = answer.get("makespan") if answer["feasible"] else None, "", ""
        of_size = per_size.setdefault(row["activities"], {"gaps": [], "missed": 0, "explained": 0})
        if answer["feasible"] and (not feasible or found < int(row["makespan"])):
            note = "WRONG: there is no such schedule"
        elif answer["feasible"]:
            gap = found / int(row["makespan"]) - 1
            of_size["gaps"].append(gap)
        elif feasible:
            of_size["missed"] += 1
            note = "not found"
        else:
            without = named(answer)
            rest = proven(Project.read(path.read_text()), without, shortest=False)
            note = f"without {sorted(without)}"
            if without and rest is not None:
                of_size["explained"] += 1
            else:
                note = f"WRONG: no schedule {note}"
        if note.startswith("WRONG"):
            wrong.append(row["file"])
        shown = f"{gap:8.1%}" if gap != "" else f"{'':8}"
        optimum, ours = row["makespan"] or "none", "none" if found is None else found
        operations = answer.get("operations", "")
        print(f"{row['file']:<12} {optimum:>8} {ours:>8} {shown} {operations:>11}  {note}")
    print()
    for size, of_size in per_size.items():
        gaps, missed = of_size["gaps"], of_size["missed"]
        feasible, infeasible = len(gaps) + missed, COUNT - len(gaps) - missed
        mean = sum(gaps) / len(gaps) if gaps else float("nan")
        optimal = sum(gap == 0 for gap in gaps)
        print(
            f"{size} activities: {len(gaps)} of {feasible} feasible ones planned, {optimal} of "
            f"them optimally, on average {mean:.1%} above the optimum; "
            f"{of_size['explained']} of {infeasible} infeasible ones explained"
        )
    if wrong:
        print("disproved:", ", ".join(wrong))
    return int(bool(wrong))


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", nargs="?", choices=["compare", "generate"], default="compare")
    parser.add_argument("--folder", type=pathlib.Path, default=FOLDER, help="the instances")
    parser.add_argument("--check", action="store_true", help="generate: write nothing, compare")
    parser.add_argument(
        "--command",
        default=f"{farside()} plan solve {{file}} --json",
        help="what solves a file; {file} is its path (default: the farside that is installed, "
        "else the one that this folder makes)",
    )
    arguments = parser.parse_args()
    if arguments.what == "generate":
        return generate(arguments.folder, arguments.check)
    return compare(arguments.folder, arguments.command)


if __name__ == "__main__":
    sys.exit(main())
