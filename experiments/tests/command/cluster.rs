//! Studies on clusters: the scripts for Slurm, with a stand-in for it and, where there is one, with
//! Slurm itself; and the script for Dask. Their results are one machine's, byte for byte.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{farside, skip, text};

/// 2 cells of 3 seeds.
const STUDY: &str = "question = 'How many arrive?'\nscenario = 'network/crater-dense'\n\
    metrics = ['arrived', 'arrival_s', 'messages.lost']\nseeds = 2\n\
    [set]\nuntil = '5s'\nteam.rovers = 2\n\
    [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = [0, '30%']\n";

/// A name and an argument that a shell must not look into.
const NAME: &str = "it's $HOME `x`.toml";
const ARGUMENTS: [&str; 4] = [
    "--seeds",
    "3",
    "--set",
    r#"links."node_*-rover_0*".loss=10%"#,
];

/// What stands in for Slurm's `sbatch`: it runs a copy of the script elsewhere, each job of an
/// array with its number, all at once, and the next script only when they are done. Jobs whose
/// numbers are in `LOST` never run, as if their node had gone down.
const SBATCH: &str = r#"#!/usr/bin/env bash
set -eu
array="" dependency="" output="" script=""
for argument; do
    case $argument in
        --array=*) array=${argument#*=} ;;
        --dependency=*) dependency=${argument#*=} ;;
        --output=*) output=${argument#*=} ;;
        --parsable) ;;
        -*) echo "no such option: $argument" >&2; exit 1 ;;
        *) script=$argument ;;
    esac
done
copy=$(mktemp)
cp "$script" "$copy"
: "${array:=$(sed -n 's/^#SBATCH --array=//p' "$script")}"
if [ -z "$array" ]; then
    status=0
    bash "$copy" >>"$output" 2>&1 || status=$?
    echo "$dependency $status" >>jobs
    rm "$copy"
    echo "12;cluster"
    exit
fi
case $array in
    *-*) numbers=$(seq "${array%-*}" "${array#*-}") ;;
    *) numbers=${array//,/ } ;;
esac
for number in $numbers; do
    case " ${LOST:-} " in *" $number "*) continue ;; esac
    SLURM_ARRAY_TASK_ID=$number bash "$copy" >>"${output//%a/$number}" 2>&1 &
done
wait
rm "$copy"
echo "11;cluster"
"#;

/// Puts what stands in for Slurm into a folder, to be found there before Slurm itself.
#[cfg(unix)]
pub(crate) fn write_stand_in(folder: &Path) {
    use std::os::unix::fs::PermissionsExt;
    let sbatch = folder.join("sbatch");
    std::fs::write(&sbatch, SBATCH).unwrap();
    std::fs::set_permissions(&sbatch, std::fs::Permissions::from_mode(0o755)).unwrap();
}

fn study(folder: &Path, more: &[&str]) -> Output {
    let output = farside(folder, &[&["study", NAME][..], &ARGUMENTS, more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    output
}

/// What one machine makes of the study, with a report, in `folder/one/results/r`.
fn on_one_machine(folder: &Path) {
    let one = place(folder, "one");
    study(&one, &["--out", "results/r"]);
    report(&one);
}

fn report(folder: &Path) {
    let output = farside(folder, &["report", "results/r"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

/// A folder with the study in it.
fn place(folder: &Path, name: &str) -> PathBuf {
    let place = folder.join(name);
    std::fs::create_dir_all(&place).unwrap();
    std::fs::write(place.join(NAME), STUDY).unwrap();
    place
}

/// Holds every file that one machine wrote to be there, with the same bytes. How the runs were
/// parted shows only in the files that hold them.
#[track_caller]
fn assert_same(folder: &Path, other: &str) {
    let results = |of: &str| folder.join(of).join("results/r");
    let mut compared = 0;
    let listed = |of: PathBuf| {
        std::fs::read_dir(of)
            .unwrap()
            .map(|entry| entry.unwrap().path())
    };
    let whole = listed(results("one")).chain(listed(results("one").join("plots")));
    for path in whole.filter(|path| path.is_file()) {
        let name = path.strip_prefix(results("one")).unwrap();
        let is_of_a_machine = ["runs.jsonl", "times.jsonl", "lock"].map(Path::new);
        if is_of_a_machine.contains(&name) {
            continue;
        }
        let there = std::fs::read(results(other).join(name));
        let there = there.unwrap_or_else(|error| panic!("{other}: {}: {error}", name.display()));
        assert_eq!(
            std::fs::read(&path).unwrap(),
            there,
            "{other}: {}",
            name.display()
        );
        compared += 1;
    }
    assert!(compared > 6, "{compared}");
}

fn answers(program: &str, arguments: &[&str]) -> bool {
    let output = Command::new(program).args(arguments).output();
    output.is_ok_and(|output| output.status.success())
}

/// With a stand-in for Slurm: a shard that never ran is named by the merge, the rest is kept, and
/// submitted again it is done.
#[test]
#[cfg(unix)]
fn the_scripts_for_slurm_do_a_study_and_say_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    on_one_machine(folder.path());
    let place = place(folder.path(), "my 'cluster' $HOME");
    let bin = folder.path().join("bin");
    std::fs::create_dir(&bin).unwrap();
    write_stand_in(&bin);
    let said = study(&place, &["--out", "results/r", "--array", "4"]);
    assert!(
        text(&said.stdout).starts_with("6 runs in 4 shards\n"),
        "{said:?}"
    );
    assert!(!place.join("results/r").exists(), "nothing is run");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", bin.display());
    let scripts = place.join("results/r-slurm");
    let submit = |arguments: &[&str], lost: &str| {
        let output = Command::new("bash")
            .arg(scripts.join("submit.sh"))
            .args(arguments)
            .envs([("PATH", path.as_str()), ("LOST", lost)])
            // Whoever runs this test may be a job of an array.
            .env_remove("SLURM_CPUS_PER_TASK")
            .current_dir(folder.path())
            .output()
            .expect("bash runs");
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout).to_owned()
    };
    let read = |name: &str| std::fs::read_to_string(scripts.join(name)).unwrap();
    let said = submit(&[], "2 4");
    assert!(
        said.starts_with("shards: job 11; merge: job 12; "),
        "{said}"
    );
    assert_eq!(read("jobs"), "afterany:11 3\n");
    let merge = read("out/merge.txt");
    let missing = "3 runs are missing, of 2 of 4 shards; submit them again: --array=2,4\n";
    assert!(merge.ends_with(missing), "{merge}");
    assert!(!place.join("results/r/results.csv").exists());
    assert!(!place.join("results/r/report.html").exists());
    submit(&["--array=2,4"], "");
    assert_eq!(read("jobs"), "afterany:11 3\nafterany:11 0\n");
    assert_same(folder.path(), "my 'cluster' $HOME");
    // All is there: everybody ends at once, and nothing changes.
    submit(&[], "");
    assert_eq!(read("jobs").lines().last(), Some("afterany:11 0"));
    assert_same(folder.path(), "my 'cluster' $HOME");
    let alone = Command::new("bash")
        .arg(scripts.join("array.sbatch"))
        .output();
    let alone = alone.expect("bash runs");
    let said = text(&alone.stderr);
    assert!(
        !alone.status.success() && said.contains("see submit.sh"),
        "{said}"
    );
}

#[test]
fn scripts_are_refused_where_they_would_do_harm() {
    let folder = tempfile::tempdir().unwrap();
    let place = place(folder.path(), "here");
    let refused = |more: &[&str]| {
        let output = farside(&place, &[&["study", NAME][..], &ARGUMENTS, more].concat());
        assert_eq!(output.status.code(), Some(2), "{more:?}");
        text(&output.stderr).to_owned()
    };
    let said = refused(&["--array", "7"]);
    assert!(
        said.contains("--array 7: the study has 6 runs: 6 at most"),
        "{said}"
    );
    for more in [
        &["--shard", "1/2"][..],
        &["--merge", "2"],
        &["--dry-run"],
        &["--check", "x"],
    ] {
        let said = refused(&[&["--array", "2"], more].concat());
        assert!(said.contains("cannot be used with"), "{said}");
    }
    assert!(refused(&["--merge", "2"]).contains("it has no manifest.json"));
    study(&place, &["--out", "r", "--array", "2"]);
    study(&place, &["--out", "r", "--array", "2"]);
    let script = place.join("r-slurm/array.sbatch");
    let text = std::fs::read_to_string(&script).unwrap();
    let changed = text.replace("##SBATCH --partition=", "#SBATCH --partition=mine");
    assert_ne!(text, changed);
    std::fs::write(&script, &changed).unwrap();
    let said = refused(&["--out", "r", "--array", "2"]);
    assert!(
        said.contains("changes for a cluster would be lost"),
        "{said}"
    );
    assert_eq!(std::fs::read_to_string(&script).unwrap(), changed);
    // A folder with fewer seeds is not the whole of what is asked for.
    study(&place, &["--out", "r"]);
    let set = ARGUMENTS[3];
    let more = ["--seeds", "4", "--set", set, "--out", "r", "--merge", "2"];
    let output = farside(&place, &[&["study", NAME], &more[..]].concat());
    assert_eq!(output.status.code(), Some(2));
    let said = crate::common::text(&output.stderr);
    assert!(said.contains("3 seeds there, 4 here"), "{said}");
}

#[test]
fn slurm_itself_does_a_study() {
    if !answers("sbatch", &["--version"]) || !answers("sinfo", &[]) {
        return skip(
            "slurm_itself_does_a_study",
            "no sbatch, or no cluster that answers sinfo",
        );
    }
    let folder = tempfile::tempdir().unwrap();
    on_one_machine(folder.path());
    let place = place(folder.path(), "slurm");
    study(&place, &["--out", "results/r", "--array", "3"]);
    let script = place.join("results/r-slurm/submit.sh");
    let submitted = Command::new("bash")
        .arg(script)
        .output()
        .expect("bash runs");
    assert!(submitted.status.success(), "{}", text(&submitted.stderr));
    let said = text(&submitted.stdout);
    let merge = said
        .split("merge: job ")
        .nth(1)
        .and_then(|rest| rest.split(';').next());
    let merge = merge.expect("it says which job the merge is");
    let waits = || {
        let queue = Command::new("squeue")
            .args(["--noheader", "--job", merge])
            .output();
        queue.is_ok_and(|queue| !queue.stdout.is_empty())
    };
    // A cluster that is busy is no fault of ours.
    let mut left_s = 120;
    while waits() && left_s > 0 {
        assert!(answers("sleep", &["1"]));
        left_s -= 1;
    }
    if left_s == 0 {
        return skip(
            "slurm_itself_does_a_study",
            "the cluster has no room for two minutes",
        );
    }
    assert_same(folder.path(), "slurm");
}

#[test]
fn dask_does_a_study() {
    if !answers("python3", &["-c", "import distributed"]) {
        return skip("dask_does_a_study", "no python3 with distributed");
    }
    let folder = tempfile::tempdir().unwrap();
    on_one_machine(folder.path());
    let place = place(folder.path(), "dask");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/cluster/cluster_study.py");
    let done = Command::new("python3")
        .arg(script)
        .args([NAME, "--out", "results/r", "--shards", "3", "--farside"])
        .arg(env!("CARGO_BIN_EXE_farside"))
        .args(ARGUMENTS)
        .current_dir(&place)
        .output()
        .expect("python runs");
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    report(&place);
    assert_same(folder.path(), "dask");
}
