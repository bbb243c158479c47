//! Results that no simulation made, of which the truth is known: for tests of statistics and
//! reports.

use farside::random::{RandomKey, Stream};
use serde_json::{Map, Value, json};

use farside_actors::system::Series;

use super::results::{
    Cell, FORMAT, Factor, Manifest, MessageCounts, Metric, Results, RunOutcome, RunRecord, Scale,
    SeriesIndex,
};

/// The virtual time at which a run is over.
pub(crate) const UNTIL_S: f64 = 1800.0;

/// A value of a factor: what it is, how people write it, and by how much it harms the team.
pub(crate) type Level = (Value, &'static str, f64);

pub(crate) fn factor(name: &str, label: &str, unit: &str, scale: Scale) -> Factor {
    Factor {
        name: name.to_owned(),
        label: label.to_owned(),
        unit: unit.to_owned(),
        scale,
    }
}

pub(crate) fn latency() -> (Factor, Vec<Level>) {
    let levels = [
        (0.005, "5ms"),
        (0.1, "100ms"),
        (0.25, "250ms"),
        (0.6, "600ms"),
        (1.3, "1.3s"),
    ];
    (
        factor("latency", "one-way latency", "s", Scale::Linear),
        levels.map(|(s, text)| (json!(s), text, 0.45 * s)).to_vec(),
    )
}

pub(crate) fn loss() -> (Factor, Vec<Level>) {
    let levels = [
        (0.0, "0"),
        (0.1, "10%"),
        (0.3, "30%"),
        (0.5, "50%"),
        (0.7, "70%"),
    ];
    (
        factor("loss", "message loss", "", Scale::Linear),
        levels.map(|(p, text)| (json!(p), text, p)).to_vec(),
    )
}

pub(crate) fn bandwidth() -> (Factor, Vec<Level>) {
    let levels = [
        (1e3, "1kbit/s"),
        (4e3, "4kbit/s"),
        (16e3, "16kbit/s"),
        (64e3, "64kbit/s"),
        (256e3, "256kbit/s"),
    ];
    let harm = [1.0, 0.6, 0.3, 0.1, 0.0];
    let levels = levels.iter().zip(harm);
    (
        factor("bandwidth", "link bandwidth", "bit/s", Scale::Log),
        levels
            .map(|((bits, text), harm)| (json!(bits), *text, harm))
            .collect(),
    )
}

pub(crate) fn planner() -> (Factor, Vec<Level>) {
    (
        factor("planner", "planner", "", Scale::Linear),
        vec![
            (json!("max-plus"), "max-plus", 0.0),
            (json!("greedy"), "greedy", 0.25),
            (json!("priority"), "priority", 0.5),
        ],
    )
}

/// A study over all combinations of the factors' levels. The mean of `time_ratio` in a cell is
/// [`true_ratio`] of the summed harm; collisions never happen.
pub(crate) fn study(name: &str, factors: Vec<(Factor, Vec<Level>)>, seeds: u64) -> Results {
    let mut cells = vec![(Vec::new(), Vec::new(), 0.0)];
    for (_, levels) in &factors {
        let extended = cells.iter().flat_map(|(values, texts, harm)| {
            levels.iter().map(move |(value, text, more)| {
                let values: Vec<Value> = [values.as_slice(), std::slice::from_ref(value)].concat();
                let texts: Vec<String> = [texts.as_slice(), &[(*text).to_owned()]].concat();
                (values, texts, harm + more)
            })
        });
        cells = extended.collect();
    }
    let runs = cells.iter().enumerate().flat_map(|(cell, (.., harm))| {
        (1..=seeds).map(move |seed| RunRecord {
            cell,
            seed,
            outcome: outcome(cell, seed, *harm),
        })
    });
    let runs = runs.collect();
    let factors: Vec<Factor> = factors.into_iter().map(|(factor, _)| factor).collect();
    let cells = cells.into_iter().map(|(values, texts, _)| Cell {
        sets: factors
            .iter()
            .zip(&texts)
            .map(|(factor, text)| format!("links.default.{}={text}", factor.name))
            .collect(),
        values,
        texts,
    });
    Results {
        manifest: Manifest {
            format: FORMAT,
            code_version: "0.1.0".to_owned(),
            study: name.to_owned(),
            question: "How far can latency and loss rise before a team stops arriving?".to_owned(),
            scenario: "network/crater-dense".to_owned(),
            scenario_text: "system = \"network\"\nuntil = \"30m\"\n\n[team]\nrovers = 20\n".into(),
            files: Default::default(),
            metrics: metrics(),
            baseline: Some(0),
            cells: cells.collect(),
            seeds: (1..=seeds).collect(),
            block: 1,
            stop: None,
            published: Vec::new(),
            report: Default::default(),
            factors,
        },
        runs,
    }
}

/// The same with a curve of `steps` values, `reward`, that falls with harm from half the way on. Of
/// some runs some values are missing, and of all runs those at the third step.
pub(crate) fn with_curves(mut results: Results, steps: u32) -> Results {
    results.manifest.metrics.insert(
        0,
        Metric {
            name: "reward".to_owned(),
            label: "reward".to_owned(),
            unit: "points".to_owned(),
            index: Some(SeriesIndex {
                label: "planning <step>".to_owned(),
                unit: "s".to_owned(),
                lengths_differ: false,
            }),
            kind: None,
            better: None,
        },
    );
    let manifest = &results.manifest;
    for run in &mut results.runs {
        let problem = manifest.problem_seed(run.seed).unwrap_or(run.seed);
        let shared = RandomKey::new(problem)
            .text("curve")
            .stream()
            .normal(9.0, 1.0);
        let mut stream = RandomKey::new(run.seed)
            .number(run.cell as u64)
            .text("curve")
            .stream();
        let value = |step: u32| {
            let past = (f64::from(step) / f64::from(steps) - 0.5).max(0.0);
            let value = shared - 3.0 * past * run.cell as f64 + stream.normal(0.0, 0.5);
            (step != 2 && !stream.chance(0.05)).then_some(value)
        };
        let values = (0..steps).map(value).collect();
        let index = (0..steps).map(|step| 0.5 * f64::from(step)).collect();
        let series = Series::new(index, values).expect("indices that rise");
        if let RunOutcome::Done { metrics, .. } = &mut run.outcome {
            metrics.insert("reward".to_owned(), series.into());
        }
    }
    results
}

fn metrics() -> Vec<Metric> {
    let metrics = [
        ("completed", "teams that all arrived", ""),
        ("time_ratio", "time ratio", ""),
        ("intervention_rate", "cycles with interventions", ""),
        ("collisions", "collisions", ""),
        ("arrival_s", "arrival of rovers", "s"),
        ("age_s", "age of information", "s"),
        ("deadlock", "deadlock", ""),
        ("messages.lost", "messages lost", "messages"),
        ("messages.sent", "messages sent", "messages"),
    ];
    let metric = |(name, label, unit): (&str, &str, &str)| Metric {
        name: name.to_owned(),
        label: label.to_owned(),
        unit: unit.to_owned(),
        index: None,
        kind: None,
        better: None,
    };
    metrics.map(metric).to_vec()
}

/// The mean time ratio of a cell that harms so much.
pub(crate) fn true_ratio(harm: f64) -> f64 {
    1.15 + 0.4 * harm + 1.6 * harm * harm
}

/// The probability that a team of a cell that harms so much ends in a deadlock.
pub(crate) fn true_deadlocks(harm: f64) -> f64 {
    (0.9 * (harm - 0.45)).clamp(0.0, 0.9)
}

fn outcome(cell: usize, seed: u64, harm: f64) -> RunOutcome {
    // What a seed does it does in every cell: the pairs have something in common.
    let by_seed = RandomKey::new(seed)
        .text("terrain")
        .stream()
        .normal(0.0, 0.15);
    let chance = RandomKey::new(seed).text("deadlock").uniform();
    let mut stream = RandomKey::new(seed).number(cell as u64).stream();
    if stream.chance(0.004) {
        return RunOutcome::Failed {
            error: format!(
                "rover_{:02} panicked at 12.5s: no <path> left & none to give",
                cell + 1
            ),
        };
    }
    let ratio =
        true_ratio(harm) + by_seed * (1.0 + harm) + 0.2 * harm * (stream.exponential(1.0) - 1.0);
    let deadlocked = chance < true_deadlocks(harm);
    let arrivals = arrivals(&mut stream, ratio, deadlocked);
    let completed = arrivals.iter().all(Option::is_some);
    let timed_out = !completed && !deadlocked;
    let latest = arrivals.iter().flatten().copied().fold(0.0, f64::max);
    let ages: Vec<f64> = (0..40)
        .map(|_| 0.2 + stream.exponential(0.5 + 4.0 * harm))
        .collect();
    let metrics = json!({
        "completed": completed,
        "time_ratio": ratio,
        "intervention_rate": (0.02 + 0.2 * harm * stream.uniform()).min(1.0),
        "collisions": 0,
        "arrival_s": arrivals,
        "age_s": ages,
        "deadlock": if deadlocked { "mutual" } else { "none" },
    });
    RunOutcome::Done {
        end: if timed_out || deadlocked {
            "stopped"
        } else {
            "completed"
        }
        .to_owned(),
        end_detail: String::new(),
        digest: format!("{:032x}", RandomKey::new(seed).number(cell as u64).hash()),
        sim_time_s: if timed_out { UNTIL_S } else { latest + 30.0 },
        timed_out,
        events: 120_000 + stream.below(20_000),
        messages: messages(&mut stream, harm),
        metrics: into_map(metrics),
        violations: Vec::new(),
        never_reached: Vec::new(),
    }
}

fn arrivals(stream: &mut Stream, ratio: f64, deadlocked: bool) -> Vec<Option<f64>> {
    let arrival = |_| {
        let time = 220.0 * ratio * (0.7 + 0.25 * stream.exponential(1.0));
        let stuck = deadlocked && stream.chance(0.4);
        (time < UNTIL_S && !stuck).then_some(time)
    };
    (0..20).map(arrival).collect()
}

fn messages(stream: &mut Stream, harm: f64) -> MessageCounts {
    let sent = 40_000 + stream.below(4000);
    let by_loss = (sent as f64 * (harm * 0.6).min(0.8)) as u64;
    let by_queue = if harm > 0.4 {
        (sent as f64 * 0.05 * harm) as u64
    } else {
        0
    };
    let by_range = 150 + stream.below(60);
    let lost = by_loss + by_queue + by_range;
    let reasons = [
        ("loss", by_loss),
        ("queue_full", by_queue),
        ("range", by_range),
    ];
    let reasons = reasons.into_iter().filter(|(_, count)| *count > 0);
    MessageCounts {
        sent,
        delivered: sent - lost - 12,
        lost,
        duplicated: 0,
        in_flight: 12,
        lost_by_reason: reasons
            .map(|(reason, count)| (reason.to_owned(), count))
            .collect(),
    }
}

fn into_map(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
