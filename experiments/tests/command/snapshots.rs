//! What people read, as it stands: the help of every command, the texts of mistakes, and three
//! small pictures. They are in `snapshots/`, and a difference fails: see `.config/insta.yaml` for
//! how one that is meant is taken over.

use std::path::Path;
use std::process::Command;

use crate::common::text;

/// Runs the command with nothing of the terminal's; gives back the exit code, stdout and stderr.
fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_farside"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("FARSIDE_LOG")
        .env_remove("CLICOLOR_FORCE")
        .env("NO_COLOR", "1")
        .env("COLUMNS", "100")
        .output()
        .expect("the binary runs");
    let [out, err] = [output.stdout, output.stderr].map(|bytes| text(&bytes).to_owned());
    let place = folder.display().to_string();
    assert!(
        !out.contains(&place) && !err.contains(&place),
        "a path: {out}{err}"
    );
    (output.status.code().expect("no signal"), out, err)
}

/// What a command prints that ends well.
fn said(folder: &Path, arguments: &[&str]) -> String {
    let (code, out, err) = run(folder, arguments);
    assert_eq!(code, 0, "{arguments:?}: {err}");
    out
}

#[test]
fn the_help_of_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let all = said(folder.path(), &["--help"]);
    insta::assert_snapshot!("help", all);
    let (_, commands) = all.split_once("Commands:\n").expect("a list of commands");
    let (commands, _) = commands.split_once("\n\n").expect("more help");
    let commands = commands
        .lines()
        .filter_map(|line| line.split_whitespace().next());
    for command in commands.filter(|command| *command != "help") {
        let help = said(folder.path(), &[command, "--help"]);
        insta::assert_snapshot!(format!("help_{command}"), help);
    }
    for command in ["check", "format", "solve", "validate", "draw"] {
        let help = said(folder.path(), &["plan", command, "--help"]);
        insta::assert_snapshot!(format!("help_plan_{command}"), help);
    }
}

/// Four rovers on a line of six vertices with two pockets.
const TINY: &str = "system = 'network'\nseed = 3\nuntil = '20s'\n\
    [world]\nnodes = 2\nradius = '100m'\nroadmap = { boundary = [0, 5], positions_m = [[0, 0], \
    [10, 0], [20, 0], [30, 0], [40, 0], [50, 0], [30, 10], [20, 10]], edges = [[0, 1], [1, 2], \
    [2, 3], [3, 4], [4, 5], [3, 6], [2, 7]] }\n[team]\nrovers = 4\n";

const LOSS: &str = "question = 'How late are rovers when links lose more?'\nscenario = 'tiny.toml'\n\
    metrics = ['time_ratio']\nseeds = 3\n\
    [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = ['0%', '10%']\n";

fn write(folder: &Path, files: &[(&str, &str)]) {
    for (name, content) in files {
        std::fs::write(folder.join(name), content).unwrap();
    }
}

#[test]
fn texts_of_mistakes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let degrade = "system = 'network'\n[[degrade]]\nat = '5s'\n";
    let study = |change: (&str, &str)| LOSS.replace(change.0, change.1);
    let files = [
        ("tiny.toml", TINY.to_owned()),
        ("system.toml", "system = 'netwrok'\n".to_owned()),
        ("no_system.toml", "seed = 3\n".to_owned()),
        ("broken.toml", "system = 'network'\nseed = \n".to_owned()),
        ("type.toml", "system = 'network'\nteam = 3\n".to_owned()),
        (
            "zero.toml",
            format!("{degrade}processors = 'node_01'\nslowdown = 0\n"),
        ),
        (
            "beside.toml",
            format!("{degrade}processors = 'node_01'\nslowdown = 2\nloss = 0.5\n"),
        ),
        ("alone.toml", format!("{degrade}slowdown = 2\n")),
        (
            "before.toml",
            format!("{degrade}until = '3s'\nlinks = '*'\nloss = 1\n"),
        ),
        ("nothing.toml", format!("{degrade}links = '*'\n")),
        ("metric.toml", study(("time_ratio", "time_ration"))),
        (
            "factor.toml",
            study(("links.default.loss", "links.default.los")),
        ),
        ("level.toml", study(("10%", "110%"))),
        ("no_name.toml", study(("name = 'loss'\n", ""))),
        ("block.toml", study(("seeds = 3", "seeds = 3\nblock = 2"))),
        ("notes.txt", "no log\n".to_owned()),
    ];
    for (name, content) in &files {
        write(folder, &[(name, content)]);
    }
    said(folder, &["run", "tiny.toml", "--out", "tiny.mcap"]);
    let set = |set: &'static str| vec!["check", "tiny.toml", "--set", set];
    let mistakes = [
        vec!["rnu"],
        vec!["run", "network/crater-dens"],
        vec!["run", "missing.toml"],
        vec!["check", "system.toml"],
        vec!["check", "no_system.toml"],
        vec!["check", "broken.toml"],
        vec!["check", "type.toml"],
        set("team.rovres=5"),
        set("team.rovers=0"),
        set("links.default.latency=5kg"),
        set("until=1.5sols"),
        set("links.default.loss=110%"),
        set("links={ 'base-*' = { loss = 0.5 } }"),
        set("crash=[{ host = 'nod_01', at = '3s' }]"),
        set("degrade=[{ at = '1s', processors = 'nod_01', slowdown = 2 }]"),
        set("degrade=[{ at = '1s', processors = 'node_1/planer', slowdown = 2 }]"),
        set("contacts={ file = 'mars-rely' }"),
        vec!["check", "zero.toml"],
        vec!["check", "beside.toml"],
        vec!["check", "alone.toml"],
        vec!["check", "before.toml"],
        vec!["check", "nothing.toml"],
        vec!["study", "metric.toml", "--out", "r"],
        vec!["study", "factor.toml", "--out", "r"],
        vec!["study", "level.toml", "--out", "r"],
        vec!["study", "no_name.toml", "--out", "r"],
        vec!["study", "block.toml", "--out", "r"],
        vec!["info", "notes.txt"],
        vec!["diff", "tiny.mcap", "missing.mcap"],
        vec!["draw", "tiny.mcap", "maps"],
        vec!["draw", "tiny.mcap", "corridor", "--along", "99"],
        vec!["report", "missing"],
        vec!["explain", "network.polcy"],
    ];
    let mut all = String::new();
    for arguments in mistakes {
        let (code, out, err) = run(folder, &arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}: {err}");
        all += &format!("$ farside {}\n{err}\n", arguments.join(" "));
    }
    insta::assert_snapshot!("mistakes", all);
}

/// Why two logs differ, and whom that reached: up to the table of topics.
#[test]
fn texts_of_differences() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(folder, &[("tiny.toml", TINY)]);
    let all = "log.exclude=[]";
    said(
        folder,
        &["run", "tiny.toml", "--set", all, "--out", "tiny.mcap"],
    );
    let loss = "links.\"node_*-rover_*\".loss=0.5";
    let forks = [
        vec!["--at", "2s", "--set", loss, "--out", "worse.mcap"],
        vec!["--at", "2s", "--crash", "node_02", "--out", "crashed.mcap"],
    ];
    for fork in forks {
        let (code, _, err) = run(folder, &[&["fork", "tiny.mcap"], fork.as_slice()].concat());
        assert_eq!(code, 1, "{err}");
    }
    let (_, json, _) = run(folder, &["diff", "tiny.mcap", "worse.mcap", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    let lost = report["spread"][0]["message"].as_str().expect("a message");
    let lose = ["fork", "tiny.mcap", "--lose", lost, "--out", "lost.mcap"];
    assert_eq!(run(folder, &lose).0, 1);
    let key = "links.default.latency=8ms";
    said(
        folder,
        &["run", "tiny.mcap", "--set", key, "--out", "key.mcap"],
    );
    said(
        folder,
        &["run", "tiny.mcap", "--until", "5s", "--out", "short.mcap"],
    );
    let mut text = String::new();
    for (other, more) in [
        ("worse.mcap", &[][..]),
        ("crashed.mcap", &[]),
        ("lost.mcap", &["--metrics"]),
        ("key.mcap", &[]),
        ("short.mcap", &[]),
    ] {
        let arguments = [&["diff", "tiny.mcap", other], more].concat();
        let (code, out, err) = run(folder, &arguments);
        assert_eq!(code, 1, "{arguments:?}: {out}{err}");
        let (told, rest) = out.split_once(" records in tiny.mcap, ").expect("a table");
        let told = told.trim_end_matches(|c: char| c.is_ascii_digit());
        let came = rest.split("\n\n").last().filter(|_| !more.is_empty());
        let came = came.unwrap_or_default();
        text += &format!("$ farside {}\n{told}{came}\n", arguments.join(" "));
    }
    insta::assert_snapshot!("differences", text);
}

#[test]
fn small_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(folder, &[("tiny.toml", TINY), ("loss.toml", LOSS)]);
    said(folder, &["run", "tiny.toml", "--out", "tiny.mcap"]);
    let picture = |name: &str, more: &[&str]| {
        said(
            folder,
            &[&["draw", "tiny.mcap", name, "--out", "p.svg"], more].concat(),
        );
        std::fs::read_to_string(folder.join("p.svg")).unwrap()
    };
    insta::assert_snapshot!("map", picture("map", &["--at", "5s"]));
    insta::assert_snapshot!("corridor", picture("corridor", &["--along", "0,5"]));
    said(folder, &["study", "loss.toml", "--out", "runs"]);
    said(folder, &["report", "runs"]);
    let page = std::fs::read_to_string(folder.join("runs/report.html")).unwrap();
    let (_, after) = page.split_once("<svg").expect("a plot");
    let (plot, _) = after.split_once("</svg>").expect("it ends");
    // An element a line: differences are read by people.
    let plot = format!("<svg{plot}</svg>\n").replace("><", ">\n<");
    insta::assert_snapshot!("plot", plot);
}
