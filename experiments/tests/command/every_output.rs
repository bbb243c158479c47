//! Each file that any command writes, beside each that it reads: by all its names it is spared. The table
//! is held against what `--help` lists, so that a new command is in it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{SMALL, farside, text};

/// The word of a command line that stands for the output.
const OUT: &str = "OUT";

/// A command and what it reads; one of its words is [`OUT`], if it writes a file.
struct Case {
    line: &'static str,
    reads: &'static [&'static str],
}

const CASES: &[Case] = &[
    Case {
        line: "run s.toml --out OUT",
        reads: &["s.toml"],
    },
    Case {
        line: "run run.mcap --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "run contacts.toml --out OUT",
        reads: &["contacts.toml", "plan.txt"],
    },
    Case {
        line: "run trace.toml --out OUT",
        reads: &["trace.toml", "trace.down"],
    },
    Case {
        line: "run map.toml --out OUT",
        reads: &["map.toml", "rubble-32-32-10.map", "rubble-32-32-10.scen"],
    },
    Case {
        line: "check contacts.toml",
        reads: &["contacts.toml", "plan.txt"],
    },
    Case {
        line: "info run.mcap",
        reads: &["run.mcap"],
    },
    Case {
        line: "cat run.mcap",
        reads: &["run.mcap"],
    },
    Case {
        line: "verify run.mcap",
        reads: &["run.mcap"],
    },
    Case {
        line: "diff run.mcap worse.mcap --html OUT",
        reads: &["run.mcap", "worse.mcap"],
    },
    Case {
        line: "fork run.mcap --at 1s --set links.default.loss=0.5 --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "why run.mcap rover_01 --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "replay run.mcap --actor rover_01",
        reads: &["run.mcap"],
    },
    Case {
        line: "ties contacts.toml --seeds 1",
        reads: &["contacts.toml", "plan.txt"],
    },
    Case {
        line: "shrink contacts.toml --violates sent>0 --out OUT",
        reads: &["contacts.toml", "plan.txt"],
    },
    Case {
        line: "shrink run.mcap --violates fault --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "shrink s.toml --violates fault --out small.toml --state OUT",
        reads: &["s.toml"],
    },
    Case {
        line: "draw run.mcap --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "draw run.mcap --sequence mermaid --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "plot run.mcap /state/rover_*/rover_state.transmit_energy_j --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "view run.mcap --html OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "recover run.mcap --out OUT",
        reads: &["run.mcap"],
    },
    Case {
        line: "problem p.toml --out OUT",
        reads: &["p.toml"],
    },
    Case {
        line: "study study.toml --out new --junit OUT",
        reads: &["study.toml", "contacts.toml", "plan.txt"],
    },
    Case {
        line: "study study.toml --out new --check results --junit OUT",
        reads: &["results/manifest.json", "results/runs.jsonl"],
    },
    Case {
        line: "study study.toml --out results --array 2",
        reads: &["study.toml", "contacts.toml", "plan.txt"],
    },
    Case {
        line: "reproduce results --cell 0 --seed 1 --out OUT",
        reads: &["results/manifest.json", "results/runs.jsonl"],
    },
    Case {
        line: "report results --out mine",
        reads: &["results/manifest.json", "results/runs.jsonl"],
    },
    Case {
        line: "plan check rover.ddl problem.ddl",
        reads: &["rover.ddl", "problem.ddl"],
    },
    Case {
        line: "plan format rover.ddl",
        reads: &["rover.ddl"],
    },
    Case {
        line: "plan solve rover.ddl problem.ddl --out OUT",
        reads: &["rover.ddl", "problem.ddl"],
    },
    Case {
        line: "plan validate rover.ddl problem.ddl plan.json",
        reads: &["rover.ddl", "problem.ddl", "plan.json"],
    },
    Case {
        line: "plan draw plan.json --out OUT",
        reads: &["plan.json"],
    },
];

/// Options with a file that is read, and those with a folder, whose files have tests of their own.
const NOT_FILES_WRITTEN: [&str; 3] = ["study --check", "study --out", "report --out"];

/// Commands that read no file.
const WITHOUT_FILES: [&str; 5] = ["scenarios", "studies", "explain", "completions", "help"];

impl Case {
    fn writes(&self) -> bool {
        self.line.split(' ').any(|word| word == OUT)
    }

    fn arguments<'a>(&'a self, out: &'a str) -> Vec<&'a str> {
        let words = self.line.split(' ');
        words
            .map(|word| if word == OUT { out } else { word })
            .collect()
    }

    /// The command with its subcommand, if it has any.
    fn command(&self) -> &str {
        let words = if self.line.starts_with("plan ") { 2 } else { 1 };
        let mut ends = self.line.match_indices(' ').map(|(at, _)| at);
        &self.line[..ends.nth(words - 1).unwrap_or(self.line.len())]
    }

    /// The option whose value is the output.
    fn option(&self) -> Option<String> {
        let before = self.line.split_once(&format!(" {OUT}"))?.0;
        let option = before.rsplit(' ').next()?;
        Some(format!("{} {option}", self.command()))
    }
}

/// A folder with all that the commands read.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (from, to) in [
        ("actors/planning/models/rover.ddl", "rover.ddl"),
        ("actors/planning/models/rover-problem.ddl", "problem.ddl"),
        (
            "worlds/data/movingai/rubble-32-32-10.map",
            "rubble-32-32-10.map",
        ),
        (
            "worlds/data/movingai/rubble-32-32-10.scen",
            "rubble-32-32-10.scen",
        ),
        ("worlds/data/contacts/rover-radio.down", "trace.down"),
    ] {
        std::fs::copy(repository.join(from), at.join(to)).unwrap();
    }
    let traffic = "system = 'traffic'\nuntil = '5s'\n[traffic]\nhosts = ['a', 'b']\n\
        flow = [{ from = 'a', to = 'b', size = '100B', period = '1s' }]\n";
    let contacts = "[contacts]\nfile = 'plan.txt'\nnodes = { 1 = 'a', 2 = 'b' }\n";
    let study = "question = 'How late?'\nscenario = 'contacts.toml'\nseeds = 1\n\
        metrics = ['sent']\n[[factor]]\nname = 'size'\nkey = 'tie_seed'\nvalues = [1, 2]\n";
    let plan = "a contact +0 +3600 1 2 1000\na range +0 +3600 1 2 1\n";
    for (name, content) in [
        (
            "s.toml",
            "system = 'network'\nuntil = '5s'\n[team]\nrovers = 2\n",
        ),
        ("contacts.toml", &format!("{traffic}{contacts}")),
        ("plan.txt", plan),
        (
            "trace.toml",
            &format!("{traffic}[links.default]\ntrace = 'trace.down'\n"),
        ),
        (
            "map.toml",
            "system = 'network'\nuntil = '5s'\n[team]\nrovers = 2\n\
             [world]\nroadmap = 'rubble-32-32-10.map'\ntasks = 'rubble-32-32-10.scen'\nnodes = 4\n[network]\npolicy = 'complete'\n",
        ),
        ("study.toml", study),
    ] {
        std::fs::write(at.join(name), content).unwrap();
    }
    let problem = farside(at, &["scenarios", "misus/planners"]);
    std::fs::write(at.join("p.toml"), problem.stdout).unwrap();
    let run = |line: &[&str]| {
        let output = farside(at, line);
        let said = text(&output.stderr);
        assert!(output.status.success(), "{line:?}: {said}");
    };
    run(&SMALL);
    let worse = [
        &SMALL[..],
        &["--set", "links.default.loss=30%", "--out", "worse.mcap"],
    ];
    run(&worse.concat());
    run(&["study", "study.toml", "--out", "results"]);
    run(&[
        "plan",
        "solve",
        "rover.ddl",
        "problem.ddl",
        "--out",
        "plan.json",
    ]);
    folder
}

/// That a command was called wrongly, said so, and changed nothing of what it reads.
fn refuses(at: &Path, case: &Case, why: &str, call: impl FnOnce() -> Output) {
    let contents = || {
        let read = |name: &&str| std::fs::read(at.join(name)).unwrap();
        case.reads.iter().map(read).collect::<Vec<_>>()
    };
    let before = contents();
    let output = call();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{}: {said}", case.line);
    assert!(said.contains(why), "{}: {said}", case.line);
    assert!(
        contents() == before,
        "{} changed what it reads: {said}",
        case.line
    );
}

const READ: &str = "is read by this command, which does not write over what it reads";

#[test]
fn no_command_writes_over_what_it_reads() {
    let folder = folder();
    let at = folder.path();
    std::fs::create_dir(at.join("names")).unwrap();
    for case in CASES.iter().filter(|case| case.writes()) {
        for input in case.reads {
            let (hard, soft) = (at.join("names/hard"), at.join("names/soft"));
            let mut names = vec![PathBuf::from(input), at.join("names/..").join(input)];
            std::fs::hard_link(at.join(input), &hard).unwrap();
            names.push(hard.clone());
            #[cfg(unix)]
            {
                // A link to another name of it, in another folder.
                std::os::unix::fs::symlink("hard", &soft).unwrap();
                names.push(soft.clone());
            }
            for name in names {
                refuses(at, case, READ, || {
                    farside(at, &case.arguments(name.to_str().unwrap()))
                });
            }
            std::fs::remove_file(hard).unwrap();
            let _ = std::fs::remove_file(soft);
        }
    }
}

#[cfg(unix)]
#[test]
fn no_command_appends_what_it_prints_to_what_it_reads() {
    let folder = folder();
    let at = folder.path();
    for case in CASES {
        for input in case.reads {
            refuses(at, case, READ, || {
                let file = std::fs::File::options().append(true).open(at.join(input));
                Command::new(env!("CARGO_BIN_EXE_farside"))
                    .args(case.arguments("new"))
                    .current_dir(at)
                    .stdout(file.unwrap())
                    .output()
                    .unwrap()
            });
            assert!(!at.join("new").exists(), "{}", case.line);
        }
    }
}

/// What is no file, and what would be one in a folder that is not there, is named; nothing is made.
#[test]
fn where_no_file_can_be_is_named() {
    let folder = folder();
    let at = folder.path();
    std::fs::create_dir(at.join("taken")).unwrap();
    std::fs::write(at.join("taken/mine.txt"), "all my work").unwrap();
    for case in CASES.iter().filter(|case| case.writes()) {
        for out in ["taken", "no/where", "s.toml/below"] {
            let output = farside(at, &case.arguments(out));
            let said = text(&output.stderr);
            let code = output.status.code();
            assert!(
                matches!(code, Some(2 | 3)) && said.contains(out) && !said.contains("panicked"),
                "{} with {out}, {code:?}: {said}",
                case.line
            );
        }
        let left = std::fs::read_dir(at.join("taken")).unwrap().count();
        assert_eq!(left, 1, "{}", case.line);
        assert!(!at.join("no").exists(), "{}", case.line);
    }
    // It is known before the study is done, or the search is begun.
    for name in ["new", "taken.tried", "small.toml"] {
        assert!(!at.join(name).exists(), "{name}");
    }
    let parts = std::fs::read_dir(at).unwrap().flatten();
    let parts = parts.filter(|entry| entry.file_name().to_string_lossy().contains(".part"));
    assert_eq!(parts.count(), 0, "parts of files are left");
}

/// The names of commands that `--help` lists, those of `plan` with it.
fn commands(at: &Path) -> Vec<String> {
    let listed = |arguments: &[&str]| -> Vec<String> {
        let help = farside(at, arguments);
        let lines = text(&help.stdout).lines().map(str::to_owned);
        let lines = lines.skip_while(|line| line != "Commands:").skip(1);
        let lines = lines.take_while(|line| !line.is_empty());
        let names = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
        let name = |line: String| line.split_whitespace().next().map(str::to_owned);
        names.filter_map(name).collect()
    };
    let mut all = listed(&["--help"]);
    all.retain(|name| name != "plan");
    let below = listed(&["plan", "--help"]);
    let below = below.iter().filter(|name| *name != "help");
    all.extend(below.map(|name| format!("plan {name}")));
    all
}

#[test]
fn every_command_is_in_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let all = commands(at);
    assert!(all.len() > 20, "{all:?}");
    for command in all {
        if WITHOUT_FILES.contains(&command.as_str()) {
            continue;
        }
        let of_it = || CASES.iter().filter(|case| case.command() == command);
        assert!(of_it().count() > 0, "no case of {command}");
        let help: Vec<&str> = command.split(' ').chain(["--help"]).collect();
        let help = farside(at, &help);
        for line in text(&help.stdout).lines() {
            let Some((option, value)) = line.trim().split_once(" <") else {
                continue;
            };
            let value = value.split('>').next().unwrap_or_default();
            let is_file = value.contains('.') || value == "FILE" || value == "DIR";
            let Some(option) = option.split(' ').find(|word| word.starts_with("--")) else {
                continue;
            };
            let name = format!("{command} {option}");
            if is_file && !NOT_FILES_WRITTEN.contains(&name.as_str()) {
                let tried = of_it().any(|case| case.option().as_ref() == Some(&name));
                assert!(tried, "no case of {name}: {line}");
            }
        }
    }
}
