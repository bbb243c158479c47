//! The runs in which a metric was worst, each with the command that makes it again: where one looks
//! first.

use maud::{Markup, html};

use super::runs;
use crate::report::measure::{Measure, Study};
use crate::study::results::{DeclaredBetter, RunRecord};
use crate::study::summary::values::{ValueKind, value_of};
use farside_actors::figure::numbers::plain;

/// How many runs are named.
const NAMED: usize = 5;

/// A run and how bad it was: the greater the worse. Of lists, what never happened comes first.
struct Bad<'a> {
    run: &'a RunRecord,
    figure: (f64, f64),
    told: String,
}

/// The worst runs of a metric over all cells; nothing where all are alike, where nobody can say
/// which way is better, and of words.
pub(super) fn section(study: &Study<'_>, measure: &Measure<'_>, folder: &str) -> Markup {
    let worst = worst(study, measure);
    html! {
        @if !worst.is_empty() {
            details {
                summary { "The worst runs, and the commands that make them again" }
                div class="scroll" tabindex="0" {
                    table {
                        thead {
                            tr {
                                th class="narrow" { "cell" } th class="name" { "values" }
                                th class="narrow" { "seed" } th { (measure.metric.label) }
                                th class="text" { "command" }
                            }
                        }
                        tbody {
                            @for Bad { run, told, .. } in &worst {
                                tr {
                                    td { (run.cell) }
                                    td class="text" { (study.cell_name(run.cell)) }
                                    td { (run.seed) }
                                    td { (told) }
                                    td class="text" {
                                        code { (runs::command(study, folder, run)) }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn worst<'a>(study: &Study<'a>, measure: &Measure<'_>) -> Vec<Bad<'a>> {
    let sign = match measure.metric.better {
        Some(DeclaredBetter::Higher) => -1.0,
        Some(DeclaredBetter::Lower) => 1.0,
        None => return Vec::new(),
    };
    let runs = study.results.runs.iter();
    let mut all: Vec<Bad<'a>> = runs
        .filter_map(|run| {
            let (figure, told) = figure_of(measure, run, sign)?;
            Some(Bad { run, figure, told })
        })
        .collect();
    let order = |a: &Bad<'_>, b: &Bad<'_>| {
        let by_figure = b.figure.0.total_cmp(&a.figure.0);
        by_figure.then(b.figure.1.total_cmp(&a.figure.1))
    };
    // Of equals the first cell and seed, as they stand.
    all.sort_by(order);
    let is_bad = |all: &[Bad<'_>]| match all {
        [first, .., last] => order(first, last).is_ne(),
        _ => false,
    };
    if !is_bad(&all) {
        return Vec::new();
    }
    // What is no worse than the best is no bad run.
    let best = all.last().map(|best| best.figure);
    all.retain(|bad| Some(bad.figure) != best);
    all.truncate(NAMED);
    all
}

/// How bad a run is, and what it says.
fn figure_of(measure: &Measure<'_>, run: &RunRecord, sign: f64) -> Option<((f64, f64), String)> {
    let value = value_of(&run.outcome, &measure.metric.name)?;
    match measure.kind {
        ValueKind::Number => {
            let number = value.as_f64()?;
            Some(((0.0, sign * number), plain(number)))
        }
        ValueKind::Rate => {
            let yes = value.as_bool()?;
            let told = if yes { "true" } else { "false" };
            Some(((0.0, sign * f64::from(u8::from(yes))), told.to_owned()))
        }
        ValueKind::List => {
            let values = value.as_array()?;
            let missing = values.iter().filter(|value| value.is_null()).count();
            let numbers = values.iter().filter_map(serde_json::Value::as_f64);
            let last = numbers.map(|number| sign * number).reduce(f64::max);
            let told = match (missing, last) {
                (0, None) => return None,
                (0, Some(last)) => plain(sign * last),
                (missing, _) => format!("{missing} of {} never", values.len()),
            };
            Some(((missing as f64, last.unwrap_or(0.0)), told))
        }
        ValueKind::Series | ValueKind::Text | ValueKind::Absent => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, loss};
    use crate::study::results::Results;
    use crate::study::summary::summarise;
    use crate::study::summary::values::number_of;

    fn worst_of(results: &Results, name: &str) -> Vec<(usize, u64, String)> {
        let summary = summarise(results);
        let study = Study::new(results, &summary);
        let measures = study.measures();
        let found = measures.iter().find(|one| one.metric.name == name);
        let worst = worst(&study, found.unwrap());
        let named = worst.iter();
        named
            .map(|bad| (bad.run.cell, bad.run.seed, bad.told.clone()))
            .collect()
    }

    fn results(better: Option<DeclaredBetter>) -> Results {
        let mut results = fabricated::study("worst", vec![loss()], 8);
        for metric in &mut results.manifest.metrics {
            metric.better = better;
        }
        results
    }

    #[test]
    fn the_worst_runs_are_those_with_the_greatest_or_least_figures() {
        let lower = results(Some(DeclaredBetter::Lower));
        let numbers = lower.runs.iter();
        let mut numbers: Vec<f64> = numbers
            .filter_map(|run| number_of(run, "time_ratio"))
            .collect();
        numbers.sort_by(f64::total_cmp);
        let most: Vec<String> = numbers
            .iter()
            .rev()
            .take(NAMED)
            .map(|x| plain(*x))
            .collect();
        let told = worst_of(&lower, "time_ratio");
        assert_eq!(
            told.iter()
                .map(|(.., told)| told.clone())
                .collect::<Vec<_>>(),
            most
        );
        let higher = results(Some(DeclaredBetter::Higher));
        let least: Vec<String> = numbers.iter().take(NAMED).map(|x| plain(*x)).collect();
        let told = worst_of(&higher, "time_ratio");
        assert_eq!(
            told.iter()
                .map(|(.., told)| told.clone())
                .collect::<Vec<_>>(),
            least
        );
        // What happened nowhere has no worst run, nor what is better neither way.
        assert!(worst_of(&lower, "collisions").is_empty());
        assert!(worst_of(&results(None), "time_ratio").is_empty());
    }

    #[test]
    fn whoever_did_not_arrive_is_worse_than_who_came_late() {
        let told = worst_of(&results(Some(DeclaredBetter::Lower)), "arrival_s");
        assert!(told[0].2.contains(" never"), "{told:?}");
    }
}
