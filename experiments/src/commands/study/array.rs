//! `farside study --array N`: scripts with which a Slurm cluster does a study.
//!
//! Three files in a folder beside the results: `array.sbatch` is one shard, `merge.sbatch` what
//! follows the shards, and `submit.sh` submits both. They hold the command as it was given, quoted,
//! with the folder and the program it was given with, because Slurm runs a copy of a script
//! elsewhere. They keep no state: what is done and what is left is in the results folder alone, so
//! that they may be submitted again at any time.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::{CommandError, Exit, output, print, print_json};
use super::Args;
use crate::study::StudyPlan;

/// The index of a job of an array is less than this unless a cluster's administrator changed it
/// (`MaxArraySize` of `slurm.conf`).
const USUAL_MAX_ARRAY_SIZE: u32 = 1001;

/// What `study --array --json` prints.
#[derive(Serialize)]
struct Document {
    shards: u32,
    /// Runs of the study; with a stopping rule, the most there may be.
    runs: usize,
    array: String,
    merge: String,
    submit: String,
}

/// What the scripts are made of.
struct JobArray<'a> {
    study: &'a str,
    shards: u32,
    program: &'a str,
    /// Where the command was given: files are looked for from there.
    started_in: &'a str,
    results: &'a str,
    /// The arguments that decide what is run.
    arguments: Vec<String>,
    /// Whether failed runs are no reason to exit with 3.
    keep_going: bool,
    cores: u16,
}

/// Writes the scripts for `shards` shards, and says how they are submitted.
///
/// # Errors
/// When there are more shards than runs, when a path is not UTF-8, when a script is one of the
/// `inputs`, or when it is there already and another: somebody may have changed it for a cluster.
pub(super) fn write(
    args: &Args,
    shards: u32,
    plan: &StudyPlan,
    folder: &Path,
    inputs: &[PathBuf],
) -> Result<Exit, CommandError> {
    let parts = plan.most_shards();
    if shards as usize > parts {
        let what = match plan.manifest.stop {
            Some(_) => "cells, which its stopping rule keeps whole",
            None => "runs",
        };
        let message = format!("--array {shards}: the study has {parts} {what}: {parts} at most");
        return Err(CommandError::Arguments(message));
    }
    let here = std::env::current_dir().map_err(|error| unnamed("this folder", &error))?;
    let program = std::env::current_exe().map_err(|error| unnamed("this program", &error))?;
    let array = JobArray {
        study: &plan.manifest.study,
        shards,
        program: utf8(program.as_os_str())?,
        started_in: utf8(here.as_os_str())?,
        results: utf8(folder.as_os_str())?,
        arguments: arguments(args),
        keep_going: args.keep_going,
        cores: args.jobs.unwrap_or(1),
    };
    let name = folder.file_name().unwrap_or(OsStr::new("results"));
    let scripts = folder.with_file_name(format!("{}-slurm", utf8(name)?));
    let files = [
        ("array.sbatch", array.shard()),
        ("merge.sbatch", array.merge()),
        ("submit.sh", array.submit()),
    ];
    let paths = files.each_ref().map(|(name, _)| scripts.join(name));
    output::spare(inputs, &paths)?;
    for (path, (_, text)) in paths.iter().zip(&files) {
        refuse_changed(path, text)?;
    }
    std::fs::create_dir_all(&scripts).map_err(cannot_write(&scripts))?;
    for (path, (_, text)) in paths.iter().zip(&files) {
        std::fs::write(path, text).map_err(cannot_write(path))?;
    }
    let [array, merge, submit] = paths.map(|path| path.display().to_string());
    let document = Document {
        shards,
        runs: plan.manifest.cells.len() * plan.manifest.seeds.len(),
        array,
        merge,
        submit,
    };
    match args.json {
        true => print_json(&document)?,
        false => print(text(&document, folder))?,
    }
    Ok(Exit::Done)
}

fn unnamed(what: &str, error: &std::io::Error) -> CommandError {
    CommandError::Arguments(format!(
        "--array: {what} has no path to write down: {error}"
    ))
}

fn utf8(path: &OsStr) -> Result<&str, CommandError> {
    path.to_str().ok_or_else(|| {
        let path = path.display();
        CommandError::Arguments(format!("--array: {path}: expected a path in UTF-8"))
    })
}

fn cannot_write(path: &Path) -> impl FnOnce(std::io::Error) -> CommandError {
    let path = path.to_owned();
    move |source| CommandError::Write { path, source }
}

/// Refuses to write over a script that says anything else.
fn refuse_changed(path: &PathBuf, text: &str) -> Result<(), CommandError> {
    match std::fs::read(path) {
        Ok(there) if there != text.as_bytes() => {
            let path = path.display();
            let message = format!(
                "{path}: is there already, and is another script: changes for a cluster would be \
                 lost\n  remove it, and it is written anew"
            );
            Err(CommandError::Arguments(message))
        }
        _ => Ok(()),
    }
}

/// The command's arguments that decide which runs there are.
fn arguments(args: &Args) -> Vec<String> {
    // A file's name may begin as an option does.
    let study = match args.study.starts_with('-') {
        true => format!("./{}", args.study),
        false => args.study.clone(),
    };
    let sets = args.sets.iter().map(|set| format!("--set={set}"));
    let seeds = args.seeds.map(|seeds| format!("--seeds={seeds}"));
    [study].into_iter().chain(sets).chain(seeds).collect()
}

fn text(document: &Document, folder: &Path) -> String {
    let Document {
        shards,
        runs,
        array,
        merge,
        submit,
    } = document;
    let many = match *shards >= USUAL_MAX_ARRAY_SIZE {
        true => "\n  many clusters take fewer: see `scontrol show config | grep MaxArraySize`"
            .to_owned(),
        false => String::new(),
    };
    format!(
        "{runs} runs in {shards} shards\n  shard    {array}\n  merge    {merge}\n  submit   bash \
         {}{many}\n  results, when the merge has ended, are in {}; a shard that fails loses nothing: \
         submit again\n",
        quoted(submit),
        folder.display()
    )
}

impl JobArray<'_> {
    /// The script of a shard.
    fn shard(&self) -> String {
        let JobArray { shards, cores, .. } = self;
        let keep_going = if self.keep_going { " --keep-going" } else { "" };
        format!(
            "\
#!/usr/bin/env bash
# A shard of a study. Slurm runs it {shards} times: `bash submit.sh`.
# The lines of #SBATCH are yours to change; one with ## is off. The number of shards is not.
{name}
#SBATCH --array=1-{shards}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={cores}
#SBATCH --requeue
#SBATCH --open-mode=append
##SBATCH --time=04:00:00
##SBATCH --mem-per-cpu=2G
##SBATCH --partition=
##SBATCH --account=
#
# A shard that fails, runs out of time or loses its node loses the runs that it was in, and no
# other: each run is written down as it ends. Submitted again, it does those that are left.
# The other shards do not notice, and the merge says which shards have runs left.
{head}
shard=${{SLURM_ARRAY_TASK_ID:?is not set: this is a job of an array, see submit.sh}}
# In place of this shell, so that the program itself is told when the time is over.
exec \"$program\" study {arguments}{keep_going} --out=\"$results\" \\
    --shard=\"$shard/{shards}\" --jobs=\"${{SLURM_CPUS_PER_TASK:-{cores}}}\"
",
            name = self.job_name(""),
            head = self.head(),
            arguments = self.arguments(),
        )
    }

    /// The script of the merge.
    fn merge(&self) -> String {
        let JobArray { shards, .. } = self;
        let keep_going = if self.keep_going { " --keep-going" } else { "" };
        format!(
            "\
#!/usr/bin/env bash
# The merge of a study's shards: `results.csv`, and the report. `bash submit.sh` submits it.
# It runs nothing itself. Where runs are missing it names the shards that have them, writes
# nothing, and ends with 3.
{name}
#SBATCH --ntasks=1
#SBATCH --requeue
#SBATCH --open-mode=append
##SBATCH --time=00:30:00
##SBATCH --mem-per-cpu=4G
##SBATCH --partition=
##SBATCH --account=
{head}
status=0
\"$program\" study {arguments}{keep_going} --out=\"$results\" --merge={shards} || status=$?
# Only if all runs are there is there a table of them. A run may still have failed or have broken
# an invariant: the report counts such runs, and this script's status tells.
if [ -e \"$results/results.csv\" ]; then
    \"$program\" report -- \"$results\" || status=$?
fi
exit \"$status\"
",
            name = self.job_name("-merge"),
            head = self.head(),
            arguments = self.arguments(),
        )
    }

    /// The script that submits both.
    fn submit(&self) -> String {
        let JobArray { shards, .. } = self;
        format!(
            "\
#!/usr/bin/env bash
# Submits a study's {shards} shards, and the merge that follows them. Submit again whatever ended
# early: shards whose runs are all there end at once. While an earlier submission still runs,
# its shards have their runs to themselves, and those of a second one end with 2.
#
# Arguments are options of the shards, as in `bash submit.sh --array=3,7` for two of them.
# Slurm's own variables hold for shards and merge: SBATCH_PARTITION, SBATCH_ACCOUNT.
set -euo pipefail
cd -- \"$(dirname -- \"${{BASH_SOURCE[0]}}\")\"
mkdir -p out
shards=$(sbatch --parsable --output=out/shard-%a.txt \"$@\" array.sbatch)
# With several clusters an answer is number;cluster.
shards=${{shards%%;*}}
# After all shards, however they end. After `afterok` a merge would wait for ever, or be cancelled
# unseen, where one shard has failed; and a shard that found a broken invariant has done its runs
# and ends with 1. What is missing is the merge's to find out: it has the runs themselves.
merge=$(sbatch --parsable --output=out/merge.txt --dependency=\"afterany:$shards\" merge.sbatch)
echo \"shards: job $shards; merge: job ${{merge%%;*}}; what they say: $PWD/out\"
"
        )
    }

    /// What comes first in each script that Slurm runs.
    fn head(&self) -> String {
        format!(
            "set -euo pipefail
# Program, folder and results are on a file system that all nodes share.
program=${{FARSIDE:-{}}}
results={}
cd -- {}
",
            quoted(self.program),
            quoted(self.results),
            quoted(self.started_in)
        )
        .trim_end()
        .to_owned()
    }

    fn arguments(&self) -> String {
        let quoted: Vec<String> = self.arguments.iter().map(|one| quoted(one)).collect();
        quoted.join(" ")
    }

    /// The line that names the job. Slurm takes the rest of the line for options: only letters
    /// and digits are left of the study's name.
    fn job_name(&self, ending: &str) -> String {
        let plain = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
        let name = self.study.chars();
        let name: String = name.map(|c| if plain(c) { c } else { '-' }).collect();
        format!("#SBATCH --job-name=farside-{name}{ending}")
    }
}

/// A word as a shell reads it back, whatever is in it.
fn quoted(word: &str) -> String {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "._-/=+,:@%".contains(letter);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use proptest::prelude::*;

    use super::quoted;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// bash reads a word back as it was, alone and as the default of a variable.
        #[test]
        fn a_shell_reads_a_quoted_word_back(word in "[ -~äé\\n\\t]{0,20}") {
            let script = format!("unset V; w=${{V:-{0}}}; printf '%s|%s.' {0} \"$w\"", quoted(&word));
            let output = Command::new("bash").arg("-c").arg(&script).output();
            let Ok(output) = output else { return Ok(()) };
            let said = String::from_utf8_lossy(&output.stdout);
            prop_assert_eq!(said, format!("{word}|{word}."), "{}", script);
        }
    }
}
