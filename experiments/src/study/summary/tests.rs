//! Summaries of studies whose truth is known.

use serde_json::json;

use super::super::fabricated::{self, latency, loss, true_ratio};
use super::values::{number_of, observations};
use super::*;
use crate::stats::survival::kaplan_meier;
use crate::study::results::RunRecord;

fn degradation() -> Results {
    fabricated::study("degradation", vec![latency(), loss()], 30)
}

fn number(summary: &CellSummary, at: usize) -> &NumberSummary {
    match &summary.metrics[at].summary {
        MetricSummary::Number(number) => number,
        other => panic!("{other:?}"),
    }
}

fn rate(summary: &CellSummary, at: usize) -> &RateSummary {
    match &summary.metrics[at].summary {
        MetricSummary::Rate(rate) => rate,
        other => panic!("{other:?}"),
    }
}

fn list(summary: &CellSummary, at: usize) -> &ListSummary {
    match &summary.metrics[at].summary {
        MetricSummary::List(list) => list,
        other => panic!("{other:?}"),
    }
}

fn done(metrics: Value, sim_time_s: f64, timed_out: bool) -> RunOutcome {
    RunOutcome::Done {
        end: "stopped".to_owned(),
        end_detail: String::new(),
        digest: String::new(),
        sim_time_s,
        timed_out,
        events: 5,
        messages: MessageCounts::default(),
        metrics: metrics.as_object().cloned().unwrap_or_default(),
        violations: Vec::new(),
        never_reached: Vec::new(),
    }
}

/// One cell with the given outcomes, seeds from 0 on.
fn one_cell(metric: &str, outcomes: Vec<RunOutcome>) -> Results {
    let mut results = fabricated::study("one", Vec::new(), 1);
    results.manifest.metrics.truncate(1);
    results.manifest.metrics[0].name = metric.to_owned();
    let runs = outcomes.into_iter().enumerate();
    results.runs = runs
        .map(|(seed, outcome)| RunRecord {
            cell: 0,
            seed: seed as u64,
            outcome,
        })
        .collect();
    results
}

#[test]
fn means_and_differences_hold_the_truth() {
    let results = degradation();
    let summary = summarise(&results);
    assert_eq!(summary.planned, 750);
    assert_eq!(summary.n + summary.failed, 750);
    let mut held = 0;
    for cell in &summary.cells {
        let harm = 0.45 * cell.factors["latency"].as_f64().unwrap()
            + cell.factors["loss"].as_f64().unwrap();
        let ratio = number(cell, 1);
        assert_eq!(ratio.n, cell.n);
        held += usize::from(ratio.ci_low <= true_ratio(harm) && true_ratio(harm) <= ratio.ci_high);
        assert!(ratio.min <= ratio.iqm && ratio.iqm <= ratio.max);
        let Some(difference) = &ratio.difference else {
            assert_eq!(cell.cell, 0);
            continue;
        };
        // Pairs share what their seed does, so that differences are known better than means.
        let truth = true_ratio(harm) - true_ratio(0.45 * 0.005);
        assert!(
            (difference.mean - truth).abs() < 0.25,
            "{difference:?} {truth}"
        );
        if harm < 0.3 {
            let width = difference.ci_high - difference.ci_low;
            assert!(width < 0.6 * (ratio.ci_high - ratio.ci_low));
        }
    }
    // The seeds are the same in all cells, so that the cells are off the same way.
    assert!(held >= 20, "{held} of 25");
}

#[test]
fn rates_are_tested_against_the_baseline() {
    let summary = summarise(&degradation());
    let (best, worst) = (rate(&summary.cells[0], 0), rate(&summary.cells[24], 0));
    assert_eq!(best.happened, best.n);
    assert!(best.ci_low > 0.85 && best.ci_high == 1.0);
    assert!(best.difference.is_none() && best.mcnemar.is_none());
    let test = worst.mcnemar.as_ref().unwrap();
    assert_eq!(test.only_here, 0);
    assert!(test.p < 1e-4 && worst.mean < 0.5, "{worst:?}");
    let difference = worst.difference.as_ref().unwrap();
    assert!(difference.ci_high < -0.3, "{difference:?}");
    // Collisions never happen, and are numbers.
    let collisions = number(&summary.cells[3], 3);
    assert_eq!((collisions.mean, collisions.max), (0.0, 0.0));
}

/// A rover that is out when the time is over might still arrive; one whose team stands still never
/// does.
#[test]
fn what_never_happens_stays_at_risk() {
    let list_of = |timed_out: bool| {
        let run = done(json!({"arrival_s": [10.0, null]}), 20.0, timed_out);
        let late = done(json!({"arrival_s": [30.0, 40.0]}), 50.0, false);
        let results = one_cell("arrival_s", vec![run, late]);
        let curve = kaplan_meier(&observations(&results, 0, "arrival_s"));
        (list(&summarise(&results).cells[0], 0).clone(), curve)
    };
    let (censored, curve) = list_of(true);
    assert_eq!(
        (censored.happened, censored.censored, censored.never),
        (3, 1, 0)
    );
    assert_eq!(curve.at(30.0).value, 0.375);
    assert_eq!(curve.at(40.0).value, 0.0);
    let (never, curve) = list_of(false);
    assert_eq!((never.happened, never.censored, never.never), (3, 0, 1));
    assert_eq!(curve.at(30.0).value, 0.5);
    assert_eq!(curve.at(1e9).value, 0.25);
    assert_eq!(never.quantiles["p75"], 40.0);
    assert_eq!(never.quantiles["p90"], f64::INFINITY);
}

#[test]
fn lists_without_nulls_have_the_quantiles_of_their_values() {
    let runs = [[1.0, 2.0], [3.0, 4.0]];
    let outcomes = runs.map(|ages| done(json!({"age_s": ages}), 9.0, false));
    let summary = summarise(&one_cell("age_s", outcomes.to_vec()));
    let ages = list(&summary.cells[0], 0);
    assert_eq!((ages.n, ages.values, ages.quantiles["p50"]), (2, 4, 2.5));
    assert_eq!(ages.quantiles.keys().next().unwrap(), "p05");
}

#[test]
fn what_is_missing_is_not_counted() {
    let outcomes = vec![
        done(json!({"ratio": 2.0}), 9.0, false),
        done(json!({"ratio": null}), 9.0, false),
        RunOutcome::Failed {
            error: "panic".to_owned(),
        },
    ];
    let summary = summarise(&one_cell("ratio", outcomes));
    let cell = &summary.cells[0];
    assert_eq!((cell.n, cell.failed, number(cell, 0).n), (2, 1, 1));
    let json = serde_json::to_value(&summary).unwrap();
    let ratio = &json["cells"][0]["metrics"]["ratio"];
    assert_eq!(
        (&ratio["mean"], &ratio["ci_low"]),
        (&json!(2.0), &json!(null))
    );
    let nothing = summarise(&one_cell("nothing", vec![done(json!({}), 9.0, false)]));
    assert_eq!(
        nothing.cells[0].metrics[0].summary,
        MetricSummary::Absent { n: 0 }
    );
}

#[test]
fn the_kernel_counts_too() {
    let results = degradation();
    let run = results.of_cell(24)[0].clone();
    let RunOutcome::Done { messages, .. } = &run.outcome else {
        panic!("seed 1 fails in cell 24: choose another");
    };
    let cases = [
        ("messages.lost", messages.lost),
        ("messages.lost.loss", messages.lost_by_reason["loss"]),
        (
            "messages.lost_by_reason.range",
            messages.lost_by_reason["range"],
        ),
        ("messages.lost.burst", 0),
        ("violations", 0),
    ];
    for (name, count) in cases {
        assert_eq!(number_of(&run, name), Some(count as f64), "{name}");
    }
    assert_eq!(number_of(&run, "messages.nonsense"), None);
    assert_eq!(kind_of(&results, "deadlock"), ValueKind::Text);
    assert_eq!(kind_of(&results, "completed"), ValueKind::Rate);
}

#[test]
fn losses_add_up() {
    let results = degradation();
    for cell in summarise(&results).cells {
        let by_reason: u64 = cell.messages.lost_by_reason.values().sum();
        assert_eq!(by_reason, cell.messages.lost);
        assert!(cell.messages.lost > 0);
    }
}

/// A cell's intervals do not hang on which other cells there are, nor on the order of runs.
#[test]
fn cells_are_summed_up_each_for_itself() {
    let all = degradation();
    let mut few = all.clone();
    few.manifest.cells.truncate(3);
    few.runs.retain(|run| run.cell < 3);
    let (all, few) = (summarise(&all), summarise(&few));
    assert_eq!(all.cells[..3], few.cells[..]);
}

#[test]
fn factors_may_be_words_or_few() {
    let planners = summarise(&fabricated::study(
        "p",
        vec![fabricated::planner(), loss()],
        4,
    ));
    assert_eq!(planners.cells.len(), 15);
    assert_eq!(planners.cells[14].factors["planner"], "priority");
    assert_eq!(planners.cells[14].texts, ["priority", "70%"]);
    let bandwidths = summarise(&fabricated::study("b", vec![fabricated::bandwidth()], 4));
    assert_eq!(bandwidths.cells[1].factors["bandwidth"], 4000.0);
}
