//! What studies promise: mistakes are said before anything runs, and what a folder ends up with
//! does not depend on interruptions, order, shards or how many runs at once.

mod curves;
mod published;
mod refused;
mod toy;

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::results::{Results, RunOutcome, RunRecord};
use super::{Ended, Interrupts, RunOptions, Shard, Study, StudyError, find_run, reproduce, run};
use toy::{Toy, plan, registry, study};

fn options(toy: &Toy, folder: &str, jobs: usize) -> RunOptions {
    let mut options = RunOptions::new(toy.path(folder));
    options.jobs = jobs;
    options
}

fn run_all(toy: &Toy, text: &str, options: &RunOptions) -> Results {
    let ended = run(
        plan(toy, text),
        options,
        &Interrupts::default(),
        &mut |_| {},
    );
    assert_eq!(ended.unwrap(), Ended::Complete);
    Results::load(&options.folder).unwrap()
}

const GRID: &str = "seeds = 6\n[[factor]]\nname = 'level'\nkey = 'toy.level'\nvalues = [1, 2, 3]\n\
    [[factor]]\nname = 'delay'\nkey = 'toy.delay'\nvalues = ['1ms', '2s']\n";

#[test]
fn jobs_and_shards_do_not_change_results() {
    let toy = Toy::new();
    let text = study(GRID);
    let whole = run_all(&toy, &text, &options(&toy, "whole", 1));
    assert_eq!((whole.runs.len(), whole.missing()), (36, 0));
    assert_eq!(whole, run_all(&toy, &text, &options(&toy, "jobs", 4)));
    // In one folder, and each in a folder of its own.
    let mut parts = Vec::new();
    for index in [3, 1, 2] {
        let shard = Shard { index, of: 3 };
        let mut one = options(&toy, "shards", 2);
        one.shard = shard;
        run_all(&toy, &text, &one);
        one.folder = toy.path(&format!("shard-{index}"));
        let part = run_all(&toy, &text, &one);
        assert_eq!(part.runs.len(), 12);
        parts.push(part);
    }
    assert_eq!(whole, Results::load(&toy.path("shards")).unwrap());
    assert_eq!(Results::merge(parts).unwrap().unwrap(), whole);
}

#[test]
fn an_interrupted_study_goes_on_where_it_was() {
    let toy = Toy::new();
    let text = study(GRID);
    let whole = run_all(&toy, &text, &options(&toy, "whole", 2));
    let options = options(&toy, "stages", 2);
    let mut starts = 0;
    loop {
        let interrupts = Interrupts::default();
        let raised = interrupts.clone();
        let ended = run(plan(&toy, &text), &options, &interrupts, &mut |progress| {
            if progress.since_start == 5 {
                raised.raise();
            }
        });
        starts += 1;
        if ended.unwrap() == Ended::Complete {
            break;
        }
    }
    assert!((4..=8).contains(&starts), "{starts}");
    assert_eq!(whole, Results::load(&options.folder).unwrap());
}

#[test]
fn every_cell_has_its_first_seeds_early() {
    let toy = Toy::new();
    let options = options(&toy, "early", 1);
    run_all(&toy, &study(GRID), &options);
    let text = std::fs::read_to_string(options.folder.join("runs.jsonl")).unwrap();
    let records = text
        .lines()
        .map(|line| serde_json::from_str::<RunRecord>(line).unwrap());
    let order: Vec<(u64, usize)> = records.map(|run| (run.seed, run.cell)).collect();
    assert!(order.is_sorted(), "{order:?}");
}

#[test]
fn panics_are_outcomes_wherever_they_happen() {
    let toy = Toy::new();
    for place in ["assemble", "handler", "conclude", "settings"] {
        let set = format!("set = {{ toy.fails = '{place}', toy.fail_seeds = [2] }}\n");
        let text = study(&(set + GRID));
        let options = options(&toy, place, 2);
        let results = run_all(&toy, &text, &options);
        assert_eq!(results.runs.len(), 36, "{place}");
        for run in &results.runs {
            match &run.outcome {
                RunOutcome::Failed { error } => {
                    assert_eq!(run.seed, 2);
                    assert!(error.contains("no luck with seed 2"), "{error}");
                }
                RunOutcome::Done { .. } => assert_ne!(run.seed, 2),
            }
        }
        let record = find_run(&results, "level=2,delay=0.001s", 2).unwrap();
        let again = reproduce(
            &results.manifest,
            record,
            &registry(),
            &Interrupts::default(),
            |_, _| Ok::<(), String>(()),
        );
        assert_eq!(again.unwrap().unwrap().differences, [], "{place}");
    }
}

#[test]
fn a_cell_that_only_fails_stops_the_study() {
    let toy = Toy::new();
    let all = "set = { toy.fails = 'handler', toy.fail_seeds = [1, 2, 3, 4, 5, 6], \
               toy.fail_level = 2 }\n";
    let text = study(&(all.to_owned() + GRID));
    let mut options = options(&toy, "hopeless", 2);
    for _start in 0..2 {
        let ended = run(
            plan(&toy, &text),
            &options,
            &Interrupts::default(),
            &mut |_| {},
        );
        let error = ended.unwrap_err();
        assert!(
            matches!(error, StudyError::CellFails { runs: 3, .. }),
            "{error}"
        );
        let error = error.to_string();
        assert!(error.contains("level = 2, delay = "), "{error}");
        let seeds = error
            .match_indices("seed ")
            .map(|(at, _)| &error[at + 5..at + 6]);
        let seeds: BTreeSet<&str> = seeds.collect();
        assert_eq!(seeds.len(), 1, "the seed is that of the text: {error}");
    }
    options.keep_going = true;
    let results = run_all(&toy, &text, &options);
    let failed = |run: &&RunRecord| matches!(run.outcome, RunOutcome::Failed { .. });
    assert_eq!(results.runs.iter().filter(failed).count(), 12);
}

#[test]
fn seeds_may_be_added_and_not_taken_away() {
    let toy = Toy::new();
    let options = options(&toy, "seeds", 2);
    let plan = |seeds| toy::plan_with(&toy, &study(GRID), Some(seeds)).unwrap();
    let go = |seeds| run(plan(seeds), &options, &Interrupts::default(), &mut |_| {});
    go(2).unwrap();
    assert_eq!(Results::load(&options.folder).unwrap().runs.len(), 12);
    go(6).unwrap();
    let whole = run_all(&toy, &study(GRID), &self::options(&toy, "at once", 2));
    assert_eq!(Results::load(&options.folder).unwrap(), whole);
    let error = go(2).unwrap_err().to_string();
    assert!(error.contains("6 seeds there, 2 here"), "{error}");
}

const STOP: &str = "[stop]\nmetric = 'value'\nwidth = 5\nmin_seeds = 5\nmax_seeds = 60\n\
    [[factor]]\nname = 'level'\nkey = 'toy.level'\nvalues = [0, 1, 2]\n";

#[test]
fn a_stopping_rule_gives_the_same_runs_however_they_come() {
    let toy = Toy::new();
    let text = study(STOP);
    let whole = run_all(&toy, &text, &options(&toy, "whole", 1));
    let counts: Vec<usize> = (0..3).map(|cell| whole.of_cell(cell).len()).collect();
    // The toy's values spread with its level.
    assert_eq!(counts[0], 5);
    assert!(counts[2] > counts[1] && counts[2] < 60, "{counts:?}");
    assert_eq!(whole.missing(), 0);
    assert_eq!(whole, run_all(&toy, &text, &options(&toy, "jobs", 7)));
    let mut parts = Vec::new();
    for index in 1..=2 {
        let mut one = options(&toy, &format!("shard {index}"), 2);
        one.shard = Shard { index, of: 2 };
        parts.push(run_all(&toy, &text, &one));
    }
    assert_eq!(Results::merge(parts).unwrap().unwrap(), whole);
    // Every cell's runs are its first seeds.
    for cell in 0..3 {
        let seeds: Vec<u64> = whole.of_cell(cell).iter().map(|run| run.seed).collect();
        assert!(seeds.iter().copied().eq(1..=seeds.len() as u64));
    }
}

#[test]
fn designs_make_the_cells_they_say() {
    let toy = Toy::new();
    let texts = |text: &str| -> Vec<String> {
        let manifest = plan(&toy, &study(text)).manifest;
        manifest
            .cells
            .iter()
            .map(|cell| cell.texts.join(" "))
            .collect()
    };
    assert_eq!(
        texts(GRID),
        ["1 1ms", "1 2s", "2 1ms", "2 2s", "3 1ms", "3 2s"]
    );
    let paired = GRID.replace("[1, 2, 3]", "[1, 2]");
    assert_eq!(
        texts(&format!("design = 'paired'\n{paired}")),
        ["1 1ms", "2 2s"]
    );
    let list = "design = 'list'\nbaseline = { level = 7 }\n\
        [[factor]]\nname = 'level'\nkey = 'toy.level'\n\
        [[factor]]\nname = 'delay'\nkey = 'toy.delay'\n\
        [[cell]]\nlevel = 3\ndelay = '1s'\n[[cell]]\ndelay = '5ms'\nlevel = 7\n";
    let manifest = plan(&toy, &study(list)).manifest;
    assert_eq!(manifest.cells[1].texts, ["7", "5ms"]);
    assert_eq!(manifest.cells[1].sets, ["toy.level=7", "toy.delay=5ms"]);
    assert_eq!(
        (manifest.baseline, manifest.factors[1].unit.as_str()),
        (Some(1), "s")
    );
    let both =
        "[[factor]]\nname = 'x'\nkeys = ['toy.level', 'toy.fail_level']\nvalues = [1.5, 2]\n";
    let manifest = plan(&toy, &study(both)).manifest;
    assert_eq!(
        manifest.cells[0].sets,
        ["toy.level=1.5", "toy.fail_level=1.5"]
    );
    assert!(manifest.scenario_text.contains("fails = \"nowhere\""));
}

/// A latin hypercube over a linear, a logarithmic and a duration range.
fn hypercube(cells: usize, seed: u64) -> Vec<super::results::Cell> {
    let text = study(&format!(
        "design = 'latin-hypercube'\ncells = {cells}\ndesign_seed = {seed}\n\
         [[factor]]\nname = 'level'\nkey = 'toy.level'\nrange = [0.5, 2.0]\n\
         [[factor]]\nname = 'fail'\nkey = 'toy.fail_level'\nrange = [0.001, 10.0]\nscale = 'log'\n\
         [[factor]]\nname = 'delay'\nkey = 'toy.delay'\nrange = ['10ms', '4s']\n"
    ));
    let study = Study::parse("cube.toml", text, "".into()).unwrap();
    study.cells
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_latin_hypercube_hits_each_part_of_each_range_once(cells in 2usize..60, seed: u32) {
        let drawn = hypercube(cells, u64::from(seed));
        prop_assert_eq!(&drawn, &hypercube(cells, u64::from(seed)));
        let (low, span) = (libm::log(0.001), libm::log(10.0) - libm::log(0.001));
        let shares: [fn(f64, f64, f64) -> f64; 3] = [
            |x, _, _| (x - 0.5) / 1.5,
            |x, low, span| (libm::log(x) - low) / span,
            |x, _, _| (x - 0.01) / 3.99,
        ];
        for (factor, share) in shares.iter().enumerate() {
            let parts: BTreeSet<usize> = drawn
                .iter()
                .map(|cell| {
                    let x = cell.values[factor].as_f64().unwrap();
                    (share(x, low, span) * cells as f64) as usize
                })
                .collect();
            prop_assert_eq!(parts, (0..cells).collect::<BTreeSet<_>>());
        }
    }

    /// Any order of the lines, any split into shards, any repetition, a cut last line: the same.
    #[test]
    fn the_order_of_records_does_not_matter(
        order in Just((0..24usize).collect::<Vec<_>>()).prop_shuffle(),
        shards in proptest::collection::vec(0..3u32, 24),
        twice in proptest::collection::vec(0..24usize, 0..4),
        cut in 0..40usize,
    ) {
        thread_local! {
            static WHOLE: (Toy, Results) = {
                let toy = Toy::new();
                let text = study(&GRID.replace("seeds = 6", "seeds = 4"));
                let results = run_all(&toy, &text, &options(&toy, "whole", 1));
                (toy, results)
            };
        }
        WHOLE.with(|(toy, whole)| {
            let folder = tempfile::tempdir().unwrap();
            let manifest = toy.path("whole").join("manifest.json");
            std::fs::copy(manifest, folder.path().join("manifest.json")).unwrap();
            let mut files = [String::new(), String::new(), String::new()];
            for at in order.iter().chain(&twice) {
                let line = serde_json::to_string(&whole.runs[*at]).unwrap();
                files[shards[*at] as usize] += &(line + "\n");
            }
            let half = serde_json::to_string(&whole.runs[0]).unwrap();
            files[0] += &half[..cut];
            for (index, text) in files.iter().enumerate() {
                let name = format!("runs-{}-of-3.jsonl", index + 1);
                std::fs::write(folder.path().join(name), text).unwrap();
            }
            let loaded = Results::load(folder.path()).unwrap();
            prop_assert_eq!(&loaded, whole);
            // The same for folders that are merged.
            let part = |shard: u32| {
                let in_part = order.iter().filter(|at| shards[**at] == shard);
                let runs = in_part.map(|at| whole.runs[*at].clone()).collect();
                Results { manifest: whole.manifest.clone(), runs }
            };
            let merged = Results::merge([part(2), part(0), part(1)]).unwrap().unwrap();
            prop_assert_eq!(&merged, whole);
            Ok(())
        })?;
    }
}
