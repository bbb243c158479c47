//! The guide in `docs/`: every command and listing in it is run, in order, chapter by chapter.
//!
//! A block of `console` has commands, each after `$ `, and what they print, with `...` for what is
//! left out: lines where it stands alone, else a part of a line. Its words after the language say
//! `exits=N` of the last command, and `needs=PACKAGE` for a Python package without which it is not
//! run. Any block may say `file=NAME`: it is written there. Rust is included from examples.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{farside, skip};

mod reference;

/// Examples of this package that the guide runs.
const EXAMPLES: [&str; 2] = ["own_actor", "own_system"];

/// The most lines of a chapter that a person still reads.
const MOST_LINES: usize = 150;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn docs() -> PathBuf {
    root().join("docs/src")
}

/// A fenced block.
struct Block {
    /// Where it begins, as in `study.md:17`.
    place: String,
    language: String,
    attributes: BTreeMap<String, String>,
    text: String,
}

impl Block {
    fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.get(name).map(String::as_str)
    }
}

/// The chapters that the table of contents lists.
fn chapters() -> Vec<String> {
    let summary = std::fs::read_to_string(docs().join("SUMMARY.md")).expect("there is a guide");
    let links = summary.split("](").skip(1);
    let names = links.filter_map(|rest| rest.split(')').next());
    names.map(str::to_owned).collect()
}

fn blocks(chapter: &str) -> Vec<Block> {
    let text = std::fs::read_to_string(docs().join(chapter)).expect("the chapter is there");
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in text.lines().enumerate() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(info)) => {
                let mut words = info.split(',');
                let language = words.next().unwrap_or_default().to_owned();
                let attributes = words.filter_map(|word| word.split_once('='));
                open = Some(Block {
                    place: format!("{chapter}:{}", number + 1),
                    language,
                    attributes: attributes
                        .map(|(k, v)| (k.to_owned(), v.to_owned()))
                        .collect(),
                    text: String::new(),
                });
            }
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(block), None) => {
                block.text.push_str(line);
                block.text.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{chapter}: a block is not closed");
    blocks
}

/// The commands of a block, each with what it is shown to print.
fn commands(block: &Block) -> Vec<(String, String)> {
    let mut commands: Vec<(String, String)> = Vec::new();
    let mut goes_on = false;
    for line in block.text.lines() {
        match (line.strip_prefix("$ "), commands.last_mut()) {
            (Some(command), _) => commands.push((command.to_owned(), String::new())),
            (None, Some((command, _))) if goes_on => {
                command.push('\n');
                command.push_str(line);
            }
            (None, Some((_, shown))) => {
                shown.push_str(line);
                shown.push('\n');
            }
            (None, None) => panic!("{}: expected a command after `$ `", block.place),
        }
        goes_on = line.ends_with('\\');
    }
    commands
}

/// Whether `text` is `pattern` with something for each `...`.
fn fits(pattern: &str, text: &str) -> bool {
    let Some((first, rest)) = pattern.split_once("...") else {
        return pattern == text;
    };
    let Some(text) = text.strip_prefix(first) else {
        return false;
    };
    let mut starts = (0..=text.len()).filter(|at| text.is_char_boundary(*at));
    starts.any(|at| fits(rest, &text[at..]))
}

/// Whether lines that were printed are those that are shown; `...` alone is any number of them.
fn are_shown(shown: &[&str], printed: &[&str]) -> bool {
    match (shown, printed) {
        ([], printed) => printed.is_empty(),
        (["...", rest @ ..], printed) => {
            (0..=printed.len()).any(|skipped| are_shown(rest, &printed[skipped..]))
        }
        ([line, rest @ ..], [first, others @ ..]) => {
            fits(line.trim_end(), first.trim_end()) && are_shown(rest, others)
        }
        (_, []) => false,
    }
}

#[test]
fn what_is_left_out_of_a_listing_may_be_anything_and_the_rest_may_not() {
    for (shown, printed, is) in [
        ("a...c", "abc", true),
        ("a...c", "abd", false),
        ("a\n...\nz", "a\nb\nc\nz", true),
        ("a\n...\nz", "a\nz", true),
        ("a\n...", "b\nz", false),
        ("a", "a\nb", false),
        ("... s, ...", "1.5 s, 3 m", true),
    ] {
        let [shown, printed] = [shown, printed].map(|text| text.lines().collect::<Vec<_>>());
        assert_eq!(are_shown(&shown, &printed), is, "{shown:?}, {printed:?}");
    }
}

fn has_python(package: &str) -> bool {
    let import = format!("import {package}");
    let output = Command::new("python3").args(["-c", &import]).output();
    output.is_ok_and(|output| output.status.success())
}

/// The folder of the binary, where examples are in `examples`.
fn built() -> PathBuf {
    let binary = Path::new(env!("CARGO_BIN_EXE_farside"));
    binary.parent().expect("it is in a folder").to_owned()
}

/// Builds an example, if it is not there: in a run of all tests it is.
fn build(example: &str) {
    let changed = |path: PathBuf| {
        std::fs::metadata(path)
            .and_then(|found| found.modified())
            .ok()
    };
    let source = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("examples")
        .join(example);
    let source = changed(source.with_extension("rs")).expect("the example is there");
    if changed(built().join("examples").join(example)).is_some_and(|built| built > source) {
        return;
    }
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--offline", "--quiet", "--example", example]);
    if built().ends_with("release") {
        cargo.arg("--release");
    }
    let status = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).status();
    assert!(status.is_ok_and(|status| status.success()), "{example}");
}

/// Runs the commands of a block in a folder.
fn run(block: &Block, folder: &Path, path: &str) {
    if let Some(package) = block
        .attribute("needs")
        .filter(|package| !has_python(package))
    {
        return skip(&block.place, &format!("no python3 with {package}"));
    }
    let commands = commands(block);
    let last = commands.len() - 1;
    for (index, (command, shown)) in commands.iter().enumerate() {
        let output = Command::new("bash")
            .args(["-c", &format!("exec 2>&1\n{command}")])
            .env("PATH", path)
            .env("DOCS", root().join("docs"))
            .env_remove("SLURM_CPUS_PER_TASK")
            .current_dir(folder)
            .output()
            .expect("bash runs");
        let printed = String::from_utf8_lossy(&output.stdout);
        let wanted = match block.attribute("exits") {
            Some(code) if index == last => code.parse().expect("a number"),
            _ => 0,
        };
        let place = &block.place;
        let code = output.status.code();
        assert_eq!(code, Some(wanted), "{place}: {command}\n{printed}");
        // Blank lines are for the eye.
        let lines = |text: &str| -> Vec<String> {
            let lines = text.lines().filter(|line| !line.trim().is_empty());
            lines.map(str::to_owned).collect()
        };
        let (shown, printed) = (lines(shown), lines(&printed));
        let [s, p] =
            [&shown, &printed].map(|all| all.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(
            shown.is_empty() || are_shown(&s, &p),
            "{place}: {command}\nis shown to print\n{}\nand prints\n{}",
            shown.join("\n"),
            printed.join("\n")
        );
    }
}

/// Holds a listing that is included to come from a file that something else builds and runs.
fn check_include(block: &Block) {
    let included = block.text.trim().strip_prefix("{{#include ");
    let included = included.and_then(|rest| rest.strip_suffix("}}"));
    let place = &block.place;
    let Some(included) = included else {
        panic!("{place}: expected {{{{#include FILE}}}}: what stands here is built by nobody")
    };
    let (file, anchor) = included.split_once(':').unwrap_or((included, ""));
    let path = docs().join(file);
    let text = std::fs::read_to_string(&path);
    let text = text.unwrap_or_else(|error| panic!("{place}: {file}: {error}"));
    assert!(
        ["/examples/", "/docs/cluster/", "../cluster/"]
            .iter()
            .any(|one| file.contains(one)),
        "{place}: {file}: is not built and run"
    );
    let begins = format!("ANCHOR: {anchor}");
    let found = text.lines().any(|line| line.trim_end().ends_with(&begins));
    assert!(
        anchor.is_empty() || found,
        "{place}: {file} has no anchor {anchor}"
    );
}

/// Does all that a chapter says, in a folder of its own.
fn follow(chapter: &str) {
    let blocks = blocks(chapter);
    let folder = tempfile::tempdir().expect("a folder");
    for example in EXAMPLES {
        let mut consoles = blocks.iter().filter(|block| block.language == "console");
        if consoles.any(|block| block.text.contains(&format!("$ {example} "))) {
            build(example);
        }
    }
    let bin = folder.path().join(".bin");
    std::fs::create_dir(&bin).expect("a folder");
    crate::cluster::write_stand_in(&bin);
    let path = std::env::var("PATH").unwrap_or_default();
    let (own, examples) = (built(), built().join("examples"));
    let path = [&bin, &own, &examples]
        .map(|one| one.display().to_string())
        .join(":")
        + ":"
        + &path;
    for block in &blocks {
        if let Some(file) = block.attribute("file") {
            std::fs::write(folder.path().join(file), &block.text).expect("it is written");
            continue;
        }
        match block.language.as_str() {
            "console" => run(block, folder.path(), &path),
            "toml" => {
                std::fs::write(folder.path().join("block.toml"), &block.text).expect("written");
                let output = farside(folder.path(), &["check", "block.toml"]);
                let said = String::from_utf8_lossy(&output.stderr);
                assert!(output.status.success(), "{}: {said}", block.place);
            }
            "rust" | "python" => check_include(block),
            other => panic!("{}: nobody runs a block of {other:?}", block.place),
        }
    }
}

#[test]
#[cfg(unix)]
fn every_command_and_listing_of_the_guide_is_as_it_says() {
    let chapters = chapters();
    let told: Vec<&String> = chapters
        .iter()
        .filter(|one| !one.starts_with("reference/"))
        .collect();
    assert!(told.len() >= 10, "{told:?}");
    let mut failed = Vec::new();
    for chapter in told {
        let text = std::fs::read_to_string(docs().join(chapter)).expect("it is there");
        assert!(text.lines().count() <= MOST_LINES, "{chapter} is too long");
        // All chapters are tried, so that one mistake hides no other.
        if std::panic::catch_unwind(|| follow(chapter)).is_err() {
            failed.push(chapter);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn every_page_of_the_guide_is_in_its_table_of_contents() {
    let mut there = BTreeSet::new();
    for folder in ["", "reference"] {
        let entries = std::fs::read_dir(docs().join(folder)).expect("the guide's folder");
        let files = entries.map(|entry| entry.expect("an entry").path());
        let files = files.filter(|path| path.is_file());
        there.extend(files.map(|path| {
            let page = path.strip_prefix(docs()).expect("below it");
            page.to_string_lossy().replace('\\', "/")
        }));
    }
    assert!(there.remove("SUMMARY.md"));
    assert_eq!(there, chapters().into_iter().collect());
}

#[test]
fn mdbook_builds_the_guide() {
    let version = Command::new("mdbook").arg("--version").output();
    if !version.is_ok_and(|output| output.status.success()) {
        return skip("mdbook_builds_the_guide", "no mdbook");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new("mdbook")
        .arg("build")
        .arg(root().join("docs"))
        .arg("--dest-dir")
        .arg(folder.path())
        .output()
        .expect("mdbook runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("ERROR"), "{said}");
    assert!(folder.path().join("reference/keys.html").exists());
}
