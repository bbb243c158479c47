//! Curves, blocks of seeds, and claims that one cell exceeds another, from the study's text to its
//! page.

mod learner;

use std::convert::Infallible;
use std::path::Path;

use farside::Executor;
use farside_logs::{LogOptions, LogWriter, Verifier, VerifyOutcome};

use super::super::results::{Manifest, Results, RunOutcome, RunRecord};
use super::super::summary::comparisons::Verdict;
use super::super::summary::{MetricSummary, summarise};
use super::super::{Ended, Interrupts, RunOptions, Study, StudyError, StudyPlan, reproduce, run};
use crate::report;
use crate::scenario::Scenario;
use farside_actors::system::{Files, Series};
use learner::registry;

/// Two planners on six problems of five runs each.
const STUDY: &str = "question = 'From when on does searching pay?'\nscenario = 'learner.toml'\n\
    seeds = 30\nblock = 5\nmetrics = [{ name = 'reward', label = 'reward', unit = 'points' }, \
    'last', 'problem']\n\
    [[factor]]\nname = 'planner'\nvariants = [{ name = 'greedy' }, \
    { name = 'search', set = { learner.gain = 0.2 } }]\n";

const CLAIMS: &str = "[[published]]\nmetric = 'reward'\ntitle = 'Figure 3'\nsource = 'A. N. \
    Other'\nvalues = [\n\
    { planner = 'search', exceeds = { planner = 'greedy' }, from_index = 15, quote = 'soon \
    more' },\n\
    { planner = 'search', exceeds = { planner = 'greedy' }, from_index = 25, by_at_most = 1 },\n\
    { planner = 'search', exceeds = { planner = 'greedy' }, from_index = 0 },\n]\n\
    [[published]]\nmetric = 'last'\ntitle = 'In the end'\nsource = 'A. N. Other'\nvalues = [\n\
    { planner = 'search', exceeds = { planner = 'greedy' }, by_at_least = 2, by_at_most = 6 },\n\
    { planner = 'greedy', exceeds = { planner = 'search' }, equal_within = 0.5 },\n]\n";

struct StudyFolder(tempfile::TempDir);

impl StudyFolder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("learner.toml"), "system = 'learner'\n").unwrap();
        StudyFolder(folder)
    }

    fn plan(&self, text: &str, seeds: Option<u64>) -> Result<StudyPlan, StudyError> {
        let study = Study::parse("x.toml", text.to_owned(), self.0.path().to_owned())?;
        study.plan(&[], seeds, &registry())
    }

    fn run(&self, text: &str, folder: &str) -> Result<Results, StudyError> {
        let mut options = RunOptions::new(self.0.path().join(folder));
        options.jobs = 2;
        let plan = self.plan(text, None)?;
        let ended = run(plan, &options, &Interrupts::default(), &mut |_| {})?;
        assert_eq!(ended, Ended::Complete);
        Ok(Results::load(&options.folder)?)
    }

    fn refused(&self, text: &str) -> String {
        match self.plan(text, None) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("not refused:\n{text}"),
        }
    }
}

fn metrics(record: &RunRecord) -> &serde_json::Map<String, serde_json::Value> {
    match &record.outcome {
        RunOutcome::Done { metrics, .. } => metrics,
        RunOutcome::Failed { error } => panic!("{error}"),
    }
}

#[test]
fn the_page_names_the_index_from_which_a_difference_holds() {
    let place = StudyFolder::new();
    let results = place.run(&format!("{STUDY}{CLAIMS}"), "whole").unwrap();
    let summary = summarise(&results);
    let MetricSummary::Series(series) = &summary.cells[1].metrics[0].summary else {
        panic!("no curve")
    };
    assert_eq!((series.n, series.points.len()), (30, 30));
    let difference = series.difference.as_ref().unwrap();
    assert_eq!((difference.family, difference.is_more), (30, Some(true)));
    // In truth it is 0.2 for each step after the tenth; chance is worth some 0.1.
    let from = difference.holds_from.unwrap();
    assert!((11.0..=13.0).contains(&from), "{from}");
    for point in difference.points.iter().filter(|point| point.index >= from) {
        assert!(point.difference.ci_low > 0.0 && point.p <= point.p_holm && point.p_holm <= 0.05);
    }
    let before = &difference.points[from as usize - 1];
    assert!(
        before.difference.ci_low <= 0.0 || before.p_holm > 0.05,
        "{before:?}"
    );
    // Problems differ by more than planners do, so a band is wider than a difference's.
    let (mean, last) = (&series.points[29], &difference.points[29].difference);
    assert!(mean.ci_high - mean.ci_low > 2.0 * (last.ci_high - last.ci_low));
    let verdicts: Vec<Verdict> = summary.comparisons.iter().map(|one| one.verdict).collect();
    use Verdict::{DoesNotHold, Holds, Undecided};
    assert_eq!(
        verdicts,
        [Holds, DoesNotHold, Undecided, Holds, DoesNotHold]
    );
    let worst = &summary.comparisons[0];
    assert_eq!(
        (worst.index, worst.indices, worst.n),
        (Some(15.0), Some(15), 30)
    );

    let report = report::build(&results, "runs");
    for said in [
        &format!("more than in the baseline from planning step {from} on, to the last, 29."),
        "Holm",
        "30 tests",
        "in 6 blocks of 5 that share a problem",
        "With fewer than 20 blocks of seeds",
        "✓ holds",
        "✗ does not hold",
        "more than planner greedy, from planning step 15 on",
        "more than planner greedy, by 2 to 6",
        "as planner search, within 0.5",
        "“soon more”",
        "reward (points)",
    ] {
        assert!(report.page.contains(said), "{said}");
    }
    let rows = report.series_csv.unwrap();
    assert_eq!(rows.lines().count(), 1 + 2 * 30);
    assert!(
        rows.contains("\n1,search,reward,points,planning step,,29,30,"),
        "{rows}"
    );
    let published = report.published_csv.unwrap();
    let row = published.lines().nth(1).unwrap();
    assert!(
        row.starts_with("1,search,reward,Figure 3,,exceeds,,30,,,,"),
        "{row}"
    );
    assert!(
        row.contains(",0,15,,,,15,") && row.ends_with(",holds"),
        "{row}"
    );
    assert!(
        published.lines().last().unwrap().contains(",equals,"),
        "{published}"
    );
    assert!(
        report.summary_csv.contains("series,30"),
        "{}",
        report.summary_csv
    );
    let json = serde_json::to_value(&summary).unwrap();
    let said = &json["cells"][1]["metrics"]["reward"];
    assert_eq!(said["kind"], "series");
    assert_eq!(said["difference"]["holds_from"], from);
    assert!(
        said["difference"]["points"][29]["p_holm"].is_number(),
        "{said}"
    );
    assert_eq!(json["comparisons"][1]["verdict"], "does_not_hold");
    if let Ok(folder) = std::env::var("FARSIDE_PAGES") {
        std::fs::write(Path::new(&folder).join("curves.html"), &report.page).unwrap();
    }
}

#[test]
fn a_block_of_seeds_shares_a_problem() {
    let place = StudyFolder::new();
    let results = place.run(STUDY, "blocks").unwrap();
    let manifest = &results.manifest;
    assert_eq!((manifest.block, manifest.problem_seed(7)), (5, Some(6)));
    let problem = |at: usize| {
        metrics(&results.of_cell(0)[at])["problem"]
            .as_f64()
            .unwrap()
    };
    for at in 0..30 {
        assert_eq!(problem(at), problem(at - at % 5), "{at}");
        assert!(problem(at) != problem((at + 5) % 30), "{at}");
    }
    let curves: Vec<_> = (0..5)
        .map(|at| &metrics(&results.of_cell(0)[at])["reward"])
        .collect();
    assert!(curves.windows(2).all(|pair| pair[0] != pair[1]));
    // Six problems are what is known, not thirty runs.
    let alone = place.run(&STUDY.replace("block = 5", ""), "alone").unwrap();
    assert!(alone.manifest.problem_seed(7).is_none());
    let mut as_runs = results.clone();
    as_runs.manifest.block = 1;
    let width = |results: &Results| match &summarise(results).cells[0].metrics[1].summary {
        MetricSummary::Number(number) => number.ci_high - number.ci_low,
        other => panic!("{other:?}"),
    };
    assert!(width(&results) > 1.3 * width(&as_runs));
    // Five problems are too few to be sure of anything.
    let mut few = place.run(&format!("{STUDY}{CLAIMS}"), "few").unwrap();
    few.runs.retain(|run| run.seed <= 25);
    let summary = summarise(&few);
    let undecided = |verdict: Verdict| verdict == Verdict::Undecided;
    assert!(summary.comparisons.iter().all(|one| undecided(one.verdict)));
    let MetricSummary::Series(series) = &summary.cells[1].metrics[0].summary else {
        panic!("no curve")
    };
    assert_eq!(series.difference.as_ref().unwrap().holds_from, None);
    // A manifest says of blocks only where there are some.
    let text = |manifest: &Manifest| serde_json::to_string(manifest).unwrap();
    assert!(text(manifest).contains("\"block\":5") && !text(&alone.manifest).contains("block"));
    assert_eq!(
        serde_json::from_str::<Manifest>(&text(manifest)).unwrap(),
        *manifest
    );
}

#[test]
fn any_point_of_a_curve_comes_back_and_its_log_can_be_verified() {
    let place = StudyFolder::new();
    let text = STUDY.replace("seeds = 30", "seeds = 10");
    let results = place.run(&text, "whole").unwrap();
    let log = place.0.path().join("run.mcap");
    for record in [&results.runs[3], &results.runs[17]] {
        let mut resolved = String::new();
        let again = reproduce::<Infallible>(
            &results.manifest,
            record,
            &registry(),
            &Interrupts::default(),
            |scenario, assembled| {
                resolved = scenario.resolved().unwrap();
                let options = LogOptions {
                    resolved: resolved.clone(),
                    ..LogOptions::default()
                };
                assembled
                    .sim
                    .observe(LogWriter::create(&log, options).unwrap());
                Ok(())
            },
        );
        let again = again.unwrap().unwrap();
        assert_eq!(again.differences, []);
        let RunOutcome::Done { metrics: now, .. } = &again.outcome else {
            panic!("{:?}", again.outcome)
        };
        let curve = Series::from_json(&now["reward"]).unwrap();
        assert_eq!(
            curve,
            Series::from_json(&metrics(record)["reward"]).unwrap()
        );
        // The log's scenario alone gives the same run.
        let files = Files::kept(Default::default());
        let scenario = Scenario::parse("log", resolved, &[], &registry(), files).unwrap();
        let seeds = scenario.seeds();
        assert_eq!(seeds.run, record.seed);
        assert_eq!(
            Some(seeds.problem),
            results.manifest.problem_seed(record.seed)
        );
        let mut assembled = scenario.assemble().unwrap();
        let verifier = Verifier::open(&log).unwrap();
        let handle = verifier.handle();
        assembled.sim.observe(verifier);
        assembled.sim.run(Executor::Inline).unwrap();
        let outcome = handle.outcome().unwrap();
        assert!(matches!(outcome, VerifyOutcome::Same { .. }), "{outcome:?}");
    }
}

#[test]
fn curves_of_one_cell_have_the_same_indices() {
    let place = StudyFolder::new();
    let uneven = STUDY.replace("[[factor]]", "[set]\nlearner.uneven = true\n[[factor]]");
    let error = place.run(&uneven, "uneven").unwrap_err().to_string();
    for said in [
        "uneven: metric reward of cell ",
        " indices, from 0 to 28, ",
        "30 indices, from 0 to 29, with seed 1",
        "expected the same indices in all runs of a cell",
        "index = { lengths_differ = true }",
    ] {
        assert!(error.contains(said), "{said}: {error}");
    }
    let declared = uneven.replace(
        "unit = 'points'",
        "unit = 'points', index = { label = 'step', lengths_differ = true }",
    );
    let results = place.run(&declared, "declared").unwrap();
    let index = results.manifest.metrics[0].index.as_ref().unwrap();
    assert_eq!((index.label.as_str(), index.lengths_differ), ("step", true));
    let MetricSummary::Series(series) = &summarise(&results).cells[0].metrics[0].summary else {
        panic!("no curve")
    };
    assert_eq!((series.points[28].n, series.points[29].n), (30, 15));
    // A folder of other making, read again.
    let path = place.0.path().join("declared/runs.jsonl");
    let lines = std::fs::read_to_string(&path).unwrap();
    std::fs::write(
        &path,
        lines.replacen("\"index\":[0.0,1.0,", "\"index\":[0.0,1.5,", 1),
    )
    .unwrap();
    let error = Results::load(&place.0.path().join("declared"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("the index 1") && error.contains("is here where"),
        "{error}"
    );
    std::fs::write(
        &path,
        lines.replacen("\"index\":[0.0,1.0,", "\"index\":[0.0,0.0,", 1),
    )
    .unwrap();
    let error = Results::load(&place.0.path().join("declared"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("no curve: index 0 at place 1"), "{error}");
}

#[test]
fn blocks_must_divide_the_seeds() {
    let place = StudyFolder::new();
    let said = |from: &str, to: &str| place.refused(&STUDY.replace(from, to));
    for (from, to, starts) in [
        (
            "seeds = 30",
            "seeds = 32",
            "x.toml:4:9: block: 32 seeds are no whole number of blocks of 5: 30 or 35 would be",
        ),
        (
            "seeds = 30",
            "seeds = [3, 1, 2]",
            "x.toml:4:9: block: 3 seeds are no whole number of blocks of 5: 5 would be",
        ),
        (
            "block = 5",
            "block = 0",
            "x.toml:4:9: block: 0: expected how many seeds",
        ),
        (
            "[[factor]]",
            "[set]\nproblem_seed = 4\n[[factor]]",
            "x.toml:4:9: block: the scenario has problem_seed = 4",
        ),
        (
            "[[factor]]",
            "[[factor]]\nname = 'p'\nkey = 'problem_seed'\nvalues = [1, 2]\n[[factor]]",
            "x.toml:4:9: block: the factor p sets problem_seed, which blocks set too",
        ),
    ] {
        let message = said(from, to);
        assert!(message.starts_with(starts), "{to}: {message}");
    }
    let error = place.plan(STUDY, Some(7)).err().unwrap().to_string();
    assert_eq!(
        error,
        "--seeds 7: no whole number of blocks of 5: 5 or 10 would be"
    );
    let stop = STUDY.replace("seeds = 30", "").replace(
        "[[factor]]",
        "[stop]\nmetric = 'last'\nwidth = 1\nmin_seeds = 7\nmax_seeds = 20\n[[factor]]",
    );
    let message = place.refused(&stop);
    assert!(
        message.contains("stop.min_seeds: 7 seeds are no whole number"),
        "{message}"
    );
    // With whole blocks a rule stops after whole blocks.
    let stop = stop
        .replace("min_seeds = 7", "min_seeds = 10")
        .replace("width = 1", "width = 3.5");
    let results = place.run(&stop, "stopped").unwrap();
    let counts: Vec<usize> = (0..2).map(|cell| results.of_cell(cell).len()).collect();
    assert!(
        counts.iter().all(|count| [10, 15, 20].contains(count)),
        "{counts:?}"
    );
    assert_eq!(results.missing(), 0);
}

#[test]
fn a_mistake_in_a_claim_is_said_where_it_stands() {
    let place = StudyFolder::new();
    let greedy = "exceeds = { planner = 'greedy' }";
    for (values, starts, holds) in [
        (
            "{ planner = 'search', exceeds = { planer = 'greedy' } }".to_owned(),
            "x.toml:13:54: published.0.values.0.exceeds.planer: unknown value \"planer\"",
            "did you mean \"planner\"?",
        ),
        (
            "{ planner = 'search', exceeds = { planner = 'gredy' } }".to_owned(),
            "x.toml:13:55: ",
            "did you mean \"greedy\"?",
        ),
        (
            format!("{{ planner = 'greedy', {greedy} }}"),
            "x.toml:13:43: ",
            "cell 0 (greedy) would be compared with itself",
        ),
        (
            format!("{{ {greedy} }}"),
            "x.toml:13:23: ",
            "compared with itself",
        ),
        (
            "{ planner = 'search', exceeds = 'greedy' }".to_owned(),
            "x.toml:13:43: ",
            "as in exceeds = { planner = ... }",
        ),
        (
            format!("{{ planner = 'search', {greedy}, by_at_least = 3, by_at_most = 2 }}"),
            "x.toml:13:97: published.0.values.0.by_at_most: 2: by_at_least is 3",
            "expected more than that",
        ),
        (
            format!("{{ planner = 'search', {greedy}, by_at_most = -1 }}"),
            "x.toml:13:",
            "by_at_most: -1: expected more than 0",
        ),
        (
            format!("{{ planner = 'search', {greedy}, by_at_least = -1 }}"),
            "x.toml:13:",
            "by_at_least: -1: expected 0 or more",
        ),
        (
            format!("{{ planner = 'search', {greedy}, by_at_most = 1, equal_within = 2 }}"),
            "x.toml:13:",
            "by_at_most: what is equal does not exceed",
        ),
        (
            format!("{{ planner = 'search', {greedy}, equal_within = 0 }}"),
            "x.toml:13:",
            "equal_within: 0: expected more than 0",
        ),
        (
            "{ planner = 'search', value = 3, from_index = 2 }".to_owned(),
            "x.toml:13:",
            "only a figure with exceeds has this key",
        ),
        (
            format!("{{ planner = 'search', {greedy}, value = 3 }}"),
            "x.toml:13:11: ",
            "2 claims: expected one of",
        ),
        (
            format!("{{ planner = 'search', {greedy}, from_idex = 3 }}"),
            "x.toml:13:",
            "did you mean \"from_index\"?",
        ),
        (
            format!("{{ planner = 'search', {greedy} }}, {{ planner = 'search', {greedy} }}"),
            "x.toml:13:",
            "another figure of this table is for cell 1 (search) too",
        ),
    ] {
        let message = place.refused(&claim("last", &values));
        assert!(message.starts_with(starts), "{values}: {message}");
        assert!(
            message.contains(holds),
            "{values}: {holds:?} is not in {message}"
        );
    }
}

/// A study in which this is claimed of a metric.
fn claim(metric: &str, values: &str) -> String {
    let head = "title = 'T'\nsource = 'S'\n";
    format!("{STUDY}[[published]]\nmetric = '{metric}'\n{head}values = [{values}]\n")
}

/// Before the other runs are made, and in a folder that has them already.
#[test]
fn what_only_a_run_can_tell_of_a_claim_is_said_where_it_stands() {
    let place = StudyFolder::new();
    let greedy = "exceeds = { planner = 'greedy' }";
    place
        .run(&STUDY.replace("seeds = 30", "seeds = 5"), "there")
        .unwrap();
    let compared = format!("{{ planner = 'search', {greedy}, from_index = 12 }}");
    for (metric, values, holds) in [
        (
            "last",
            compared.as_str(),
            "from_index: last is no curve, so it has no index",
        ),
        (
            "reward",
            &compared.replace("12", "30"),
            "x.toml:13:80: published.0.values.0.from_index: 30: the last index of reward is 29",
        ),
        (
            "reward",
            "{ value = 3 }",
            "reward is a curve: expected exceeds, and no figure",
        ),
    ] {
        let text = claim(metric, values).replace("seeds = 30", "seeds = 5");
        for folder in ["there", "fresh"] {
            let error = place.run(&text, folder).unwrap_err().to_string();
            assert!(
                error.contains(holds),
                "{folder}: {holds:?} is not in {error}"
            );
        }
        assert!(!place.0.path().join("fresh").exists());
    }
}

#[test]
fn a_problem_or_the_ties_may_be_a_factor() {
    let place = StudyFolder::new();
    let text = "question = 'x?'\nscenario = 'learner.toml'\nseeds = 2\n\
        metrics = ['problem', 'last']\n[[factor]]\nname = 'p'\nkey = 'problem_seed'\n\
        values = [7, 9]\n[[factor]]\nname = 'ties'\nkey = 'tie_seed'\nvalues = [1, 2]\n";
    let results = place.run(text, "factors").unwrap();
    let problem = |cell: usize, at: usize| &metrics(&results.of_cell(cell)[at])["problem"];
    assert_eq!(problem(0, 0), problem(0, 1));
    assert_ne!(problem(0, 0), problem(2, 0));
    assert_eq!(problem(0, 0), problem(1, 0));
    assert_eq!(
        results.manifest.cells[1].sets,
        ["problem_seed=7", "tie_seed=2"]
    );
}
