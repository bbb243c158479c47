//! Every command that is given a log, with logs that are cut anywhere and damaged anyhow: an answer or an
//! error, never a panic, and never more than a few bytes for a few.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use farside::Executor;
use farside_logs::{Compression, LogOptions, LogWriter};

use super::{Exit, Registry, asked_for, command_line, dispatch};
use crate::commands::kept::printed;
use crate::scenario::Scenario;

/// The commands, with a log that is broken and one that is whole.
const COMMANDS: &[&[&str]] = &[
    &["info", "BROKEN"],
    &["info", "BROKEN", "--topics"],
    &["info", "BROKEN", "--json"],
    &["verify", "BROKEN", "--executor", "inline"],
    &["verify", "BROKEN", "--executor", "inline", "--json"],
    &["diff", "BROKEN", "WHOLE"],
    &["diff", "WHOLE", "BROKEN", "--tolerance", "1e-9", "--json"],
    &[
        "run",
        "BROKEN",
        "--executor",
        "inline",
        "--no-log",
        "--json",
    ],
    &["draw", "BROKEN", "--list"],
    &["view", "BROKEN", "--html", "OUT.html"],
    &["diff", "WHOLE", "BROKEN", "--html", "OUT.diff.html"],
    &["draw", "BROKEN", "--out", "OUT.svg"],
    &[
        "fork",
        "BROKEN",
        "--at",
        "300ms",
        "--set",
        "links.default.loss=0.5",
        "--executor",
        "inline",
        "--out",
        "OUT.fork.mcap",
    ],
    &["recover", "BROKEN", "--out", "OUT.mcap"],
    &["recover", "BROKEN", "--out", "OUT.mcap", "--json"],
    &["cat", "BROKEN"],
    &["cat", "BROKEN", "--csv"],
    &["plot", "BROKEN", "/**.ordinal", "--out", "OUT.plot.svg"],
    &[
        "draw",
        "BROKEN",
        "--sequence",
        "mermaid",
        "--out",
        "OUT.mmd",
    ],
    &["draw", "BROKEN", "--causes", "--out", "OUT.dot"],
    &["why", "BROKEN", "a"],
    &["why", "BROKEN", "rover_01", "--json"],
    &["replay", "BROKEN", "--actor", "*"],
    &["ties", "BROKEN", "--seeds", "1", "--jobs", "1", "--json"],
    &[
        "shrink",
        "BROKEN",
        "--violates",
        "violation",
        "--budget",
        "2",
        "--jobs",
        "1",
        "--out",
        "OUT.toml",
    ],
    // What takes something else and is given a log.
    &["check", "BROKEN"],
    &["study", "BROKEN", "--out", "OUT.study"],
    &["report", "BROKEN"],
    &["plan", "check", "BROKEN"],
];

/// A small log of these settings: chunks are compressed or not.
fn log(scenario: &str, sets: &[&str], compression: Compression) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let scenario = Scenario::open(scenario, &sets, &Registry::builtin()).unwrap();
    let mut assembled = scenario.assemble().unwrap();
    let options = LogOptions {
        scenario: scenario.name().to_owned(),
        resolved: scenario.resolved().unwrap(),
        compression,
        ..LogOptions::default()
    };
    let writer = LogWriter::create(&path, options).unwrap();
    assembled.sim.observe(writer);
    assembled.sim.run(Executor::Inline).unwrap();
    std::fs::read(&path).unwrap()
}

fn traffic(compression: Compression) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    let text = "system = 'traffic'\nuntil = '900ms'\n[traffic]\nhosts = ['a', 'b']\n\
        flow = [{ from = 'a', to = 'b', size = '40B', period = '200ms' }]\n\
        [links.default]\nloss = 0.3\n[[crash]]\nactor = 'b'\nat = '500ms'\nrestart = '700ms'\n";
    std::fs::write(&path, text).unwrap();
    log(&path.display().to_string(), &[], compression)
}

fn network(compression: Compression) -> Vec<u8> {
    let sets = ["team.rovers=2", "until=2s"];
    log("network/crater-dense", &sets, compression)
}

/// Gives every command the broken log; panics, saying with what, if one of them does.
fn try_all(folder: &Path, broken: &[u8], what: &dyn Fn() -> String) {
    std::fs::write(folder.join("BROKEN"), broken).unwrap();
    for command in COMMANDS {
        let in_folder = |word: &&str| match word.starts_with(char::is_uppercase) {
            true => folder.join(word).display().to_string(),
            false => (*word).to_owned(),
        };
        let arguments = std::iter::once("farside".to_owned()).chain(command.iter().map(in_folder));
        let registry = Registry::builtin();
        let matches = command_line(&registry)
            .try_get_matches_from(arguments)
            .unwrap();
        let cli = asked_for(&matches, &registry).unwrap();
        let (ended, said) =
            printed(|| catch_unwind(AssertUnwindSafe(|| dispatch(cli.command, &registry))));
        let ended = ended.unwrap_or_else(|_| panic!("{command:?} panicked: {}", what()));
        let said = String::from_utf8(said).unwrap();
        match ended {
            // Without a message `cat` has nothing to print, and says on stderr where the log is cut.
            Ok(Exit::Done | Exit::Different) => {
                assert!(
                    !said.is_empty() || command[0] == "cat",
                    "{command:?}: {}",
                    what()
                )
            }
            Ok(Exit::Wrong | Exit::Failed) => {}
            Err(error) => assert!(!error.to_string().is_empty()),
        }
        assert!(
            !said.contains("panicked"),
            "{command:?}: {}: {said}",
            what()
        );
        if command.contains(&"--json") && !said.is_empty() {
            let read: Result<serde_json::Value, _> = serde_json::from_str(&said);
            assert!(read.is_ok(), "{command:?}: {}: {said}", what());
        }
    }
}

/// A folder in memory, if the system has one: tests write many files.
fn folder_with(whole: &[u8]) -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    let folder = match memory.is_dir() {
        true => tempfile::tempdir_in(memory),
        false => tempfile::tempdir(),
    };
    let folder = folder.unwrap();
    std::fs::write(folder.path().join("WHOLE"), whole).unwrap();
    folder
}

/// Numbers that look random, from a seed.
struct Draws(u64);

impl Draws {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % bound.max(1) as u64) as usize
    }
}

/// Takes the checksums of chunks and of the data away, so that damage reaches what is in them.
fn without_checksums(log: &mut [u8]) {
    let mut at = 8;
    while at + 9 <= log.len() {
        let length = u64::from_le_bytes(log[at + 1..at + 9].try_into().unwrap()) as usize;
        match log[at] {
            6 => log[at + 9 + 24..at + 9 + 28].fill(0),
            0x0f => log[at + 9..at + 13].fill(0),
            _ => {}
        }
        at += 9 + length;
    }
}

/// Some damage, drawn from a seed.
fn damaged(log: &[u8], seed: u64) -> Vec<u8> {
    let mut draws = Draws(seed);
    let mut broken = log.to_vec();
    for _ in 0..=draws.below(4) {
        let at = 8 + draws.below(broken.len().saturating_sub(8));
        let end = (at + 1 + draws.below(30)).min(broken.len());
        let value = draws.below(256) as u8;
        match draws.below(8) {
            0 | 1 => broken[at] ^= 1 << draws.below(8),
            2 => broken[at] = value,
            3 => broken[at..end].fill(value),
            4 => drop(broken.drain(at..end)),
            5 => drop(broken.splice(at..at, (at..end).map(|_| value))),
            6 => broken.truncate(at.max(9)),
            // A number of two, four or eight bytes that says that there is very much.
            _ => {
                let bytes = [2, 4, 8][draws.below(3)];
                let huge = [
                    u64::MAX,
                    1 << 40,
                    1 << 31,
                    0x7fff_ffff_ffff_ffff,
                    0xffff_fff0,
                ];
                let huge = huge[draws.below(5)].to_le_bytes();
                let there = bytes.min(broken.len() - at);
                broken[at..at + there].copy_from_slice(&huge[..there]);
            }
        }
        if broken.len() < 10 {
            break;
        }
    }
    broken
}

/// Cuts at each `step`th place of a small log, and so many corruptions of a small one and of a larger one.
/// They are tried on all cores: what is printed is kept by thread.
fn hostile(step: usize, corruptions: u64) {
    let small = traffic(Compression::Zstd);
    let mut kinds = Vec::new();
    for compression in [Compression::Zstd, Compression::None] {
        kinds.push(traffic(compression));
        kinds.push(network(compression));
    }
    // In half of them nothing says that something is damaged.
    for log in kinds.clone() {
        let mut log = log;
        without_checksums(&mut log);
        kinds.push(log);
    }
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let work = &|worker: usize| {
        let folder = folder_with(&small);
        let cuts = (0..small.len()).step_by(step);
        for cut in cuts.skip(worker).step_by(workers) {
            try_all(folder.path(), &small[..cut], &|| format!("cut at {cut}"));
        }
        let folders: Vec<_> = kinds.iter().map(|log| folder_with(log)).collect();
        for seed in (worker as u64..corruptions).step_by(workers) {
            let at = seed as usize % kinds.len();
            let broken = damaged(&kinds[at], seed);
            try_all(folders[at].path(), &broken, &|| {
                format!("log {at}, seed {seed}")
            });
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..workers)
            .map(|worker| scope.spawn(move || work(worker)))
            .collect();
        for thread in threads {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
    });
}

#[test]
fn no_command_panics_at_some_broken_logs() {
    hostile(401, 40);
}

#[test]
#[ignore = "ten thousand corruptions, through every command: tens of minutes"]
fn no_command_panics_at_any_broken_log() {
    hostile(1, 10_000);
}

/// A command that is new is tried, or stands here as one that is never given a file of messages.
#[test]
fn every_command_is_tried() {
    const NO_LOG: [&str; 7] = [
        "completions",
        "explain",
        "help",
        "problem",
        "reproduce",
        "scenarios",
        "studies",
    ];
    let command = command_line(&Registry::builtin());
    for name in command.get_subcommands().map(|of| of.get_name()) {
        let tried = COMMANDS.iter().any(|words| words[0] == name);
        assert!(tried || NO_LOG.contains(&name), "{name} is not tried");
    }
}
