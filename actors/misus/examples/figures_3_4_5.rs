//! The paper's evaluation (section 5): Figures 3, 4 and 5, and the traverse, of 30 problems with 5 runs of three
//! planners each, beside what the paper says of them.
//!
//!     cargo run --release -p farside-misus --example figures_3_4_5 [-- STEP_END [ITERATIONS]]
//!
//! With another end of steps (`iterations`, `first-better`, `restart`) and so many iterations, if these are given:
//! what the paper leaves open.
//!
//! Means are over all runs; differences are paired by problem: t is that of the means of each problem's runs,
//! and over 2.05 a difference is significant (29 degrees of freedom, two-sided, 5 %).

use std::error::Error;

use farside::random::RandomKey;
use farside_misus::planner::casper::{Choice, PlannerConfig, StepEnd};
use farside_misus::planner::instance::Instance;
use farside_misus::planner::plan::violations;
use farside_misus::planner::problem::{ProblemConfig, generate};
use farside_misus::planner::rounds::{Rounds, run};

const PROBLEMS: u64 = 30;
const RUNS: u64 = 5;
const CHOICES: [Choice; 3] = [Choice::Idgs, Choice::SimpleReward, Choice::Random];
/// Over this a difference of 30 pairs is significant.
const SIGNIFICANT: f64 = 2.045;

/// By problem and step, the mean over runs.
type Means = Vec<Vec<f64>>;

/// Of one planner.
#[derive(Default)]
struct Curves {
    score: Means,
    goals: Means,
    traverse_m: Means,
    operations: Means,
    iterations: Means,
    complete: u64,
    shed: u64,
}

/// How rovers plan, but for the choice of the next goal: the defaults, or what the command line says.
fn protocol() -> Result<PlannerConfig, Box<dyn Error>> {
    let mut config = PlannerConfig::default();
    let mut words = std::env::args().skip(1);
    if let Some(word) = words.next() {
        config.step_end = match word.as_str() {
            "iterations" => StepEnd::Iterations,
            "first-better" => StepEnd::FirstBetter,
            "restart" => StepEnd::Restart,
            _ => {
                let message = format!("{word}: expected iterations, first-better or restart");
                return Err(message.into());
            }
        };
    }
    if let Some(word) = words.next() {
        config.iterations = word.parse().map_err(|error| format!("{word}: {error}"))?;
    }
    Ok(config)
}

fn main() -> Result<(), Box<dyn Error>> {
    let protocol = protocol()?;
    let mut curves: [Curves; 3] = Default::default();
    let mut violated = 0;
    let mut incomplete = 0;
    for seed in 0..PROBLEMS {
        let problem = generate(&ProblemConfig::default(), seed)?;
        let instance = Instance::new(&problem)?;
        let mut complete = false;
        for (choice, curves) in CHOICES.into_iter().zip(&mut curves) {
            let config = PlannerConfig {
                choice,
                ..protocol.clone()
            };
            let runs = (0..RUNS).map(|number| {
                let key = RandomKey::new(seed).text("run").number(number);
                run(&problem, &instance, &config, key)
            });
            let runs: Vec<Rounds> = runs.collect::<Result<_, _>>()?;
            for rounds in &runs {
                violated += violations(&problem, &rounds.plan).len();
                let all = rounds.goals.last() == Some(&(instance.goals() as f64));
                curves.complete += u64::from(all);
                curves.shed += rounds.shed;
                complete |= all;
            }
            curves.score.push(mean(&runs, |rounds| &rounds.score));
            curves.goals.push(mean(&runs, |rounds| &rounds.goals));
            curves
                .traverse_m
                .push(mean(&runs, |rounds| &rounds.traverse_m));
            curves
                .operations
                .push(mean(&runs, |rounds| &rounds.operations));
            curves
                .iterations
                .push(mean(&runs, |rounds| &rounds.iterations));
        }
        incomplete += u64::from(!complete);
    }
    table(&curves);
    claims(&curves, violated, incomplete);
    Ok(())
}

fn mean(runs: &[Rounds], of: fn(&Rounds) -> &Vec<f64>) -> Vec<f64> {
    let steps = of(&runs[0]).len();
    let sum = |step| runs.iter().map(|rounds| of(rounds)[step]).sum::<f64>();
    (0..steps)
        .map(|step| sum(step) / runs.len() as f64)
        .collect()
}

/// The mean over problems.
fn at(means: &Means, step: usize) -> f64 {
    means.iter().map(|steps| steps[step - 1]).sum::<f64>() / means.len() as f64
}

/// The mean over problems and steps.
fn overall(means: &Means) -> f64 {
    let steps = means[0].len();
    (1..=steps).map(|step| at(means, step)).sum::<f64>() / steps as f64
}

/// The t of the differences between planners at a step, paired by problem; 0 if there is none.
fn t(first: &Means, second: &Means, step: usize) -> f64 {
    let pairs = first.iter().zip(second);
    let differences: Vec<f64> = pairs.map(|(a, b)| a[step - 1] - b[step - 1]).collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let squares = differences
        .iter()
        .map(|difference| (difference - mean) * (difference - mean));
    let error = libm::sqrt(squares.sum::<f64>() / (n - 1.0) / n);
    if mean == 0.0 { 0.0 } else { mean / error }
}

/// How many operations `curves` took to score `least` in the mean.
fn operations_to(curves: &Curves, least: f64) -> f64 {
    let mut operations = 0.0;
    for step in 1..=curves.score[0].len() {
        operations += at(&curves.operations, step);
        if at(&curves.score, step) >= least {
            break;
        }
    }
    operations
}

fn table(curves: &[Curves; 3]) {
    println!(
        "idgs / simple-reward / random: means of {PROBLEMS} problems, {RUNS} runs each; t of idgs over each"
    );
    println!(
        "{:>4}  {:>17} {:>11}  {:>14} {:>11}  {:>11}  {:>14}",
        "step", "score", "t", "goals", "t", "traverse m", "operations"
    );
    for step in [1, 2, 3, 5, 10, 15, 20] {
        let [idgs, simple, random] = curves;
        let all = |of: fn(&Curves) -> &Means, digits: usize| {
            let values = curves
                .iter()
                .map(|curves| format!("{:.*}", digits, at(of(curves), step)));
            values.collect::<Vec<_>>().join("/")
        };
        let against = |of: fn(&Curves) -> &Means| {
            let against = |other| t(of(idgs), of(other), step);
            format!("{:+.1}/{:+.1}", against(simple), against(random))
        };
        println!(
            "{step:>4}  {:>17} {:>11}  {:>14} {:>11}  {:>11}  {:>14}",
            all(|curves| &curves.score, 0),
            against(|curves| &curves.score),
            all(|curves| &curves.goals, 1),
            against(|curves| &curves.goals),
            all(|curves| &curves.traverse_m, 0),
            all(|curves| &curves.operations, 0),
        );
    }
    let all = |of: fn(&Curves) -> f64| {
        curves
            .iter()
            .map(of)
            .map(|at| format!("{at:.0}"))
            .collect::<Vec<_>>()
            .join("/")
    };
    println!(
        "operations a step: {}",
        all(|curves| overall(&curves.operations))
    );
    println!(
        "iterations a step: {}",
        all(|curves| overall(&curves.iterations))
    );
    println!(
        "goals shed a run: {}",
        all(|curves| curves.shed as f64 / (PROBLEMS * RUNS) as f64)
    );
}

fn claims(curves: &[Curves; 3], violated: usize, incomplete: u64) {
    let [idgs, others @ ..] = curves;
    let steps = idgs.score[0].len();
    let say = |holds: bool, claim: &str, found: String| {
        println!("{}  {claim}: {found}", if holds { "yes" } else { "NO " });
    };
    let least = |from: usize, of: fn(&Curves) -> &Means, sign: f64| {
        let all = others
            .iter()
            .flat_map(|other| (from..=steps).map(move |step| sign * t(of(idgs), of(other), step)));
        all.fold(f64::INFINITY, f64::min)
    };
    println!("\nwhat the paper says (Figures 3 to 5), and what is found here:");
    let found = least(3, |curves| &curves.score, 1.0);
    say(
        found > SIGNIFICANT,
        "idgs scores more at all but the first few steps, significantly",
        format!("least t from step 3 on {found:.1}"),
    );
    let found = least(15, |curves| &curves.goals, -1.0);
    say(
        found > 0.0,
        "with fewer goals at the majority of steps",
        format!("least t of fewer from step 15 on {found:.1}"),
    );
    let shares = others
        .iter()
        .map(|other| 1.0 - at(&idgs.traverse_m, steps) / at(&other.traverse_m, steps));
    let shares: Vec<f64> = shares.collect();
    say(
        shares.iter().all(|share| *share > 0.0),
        "with a traverse up to 15 % shorter",
        format!(
            "by {:.0} % and {:.0} %",
            100.0 * shares[0],
            100.0 * shares[1]
        ),
    );
    let found: Vec<f64> = others
        .iter()
        .map(|other| overall(&idgs.operations) / overall(&other.operations) - 1.0)
        .collect();
    say(
        found.iter().all(|share| share.abs() < 0.1),
        "without additional planning time",
        format!(
            "operations a step {:+.0} % and {:+.0} %, an iteration {:+.0} % and {:+.0} %",
            100.0 * found[0],
            100.0 * found[1],
            100.0 * (each(idgs) / each(&others[0]) - 1.0),
            100.0 * (each(idgs) / each(&others[1]) - 1.0),
        ),
    );
    effort(idgs, others, steps);
    say(
        5 * incomplete >= 4 * PROBLEMS,
        "no planner achieves all goals",
        format!("on {incomplete} of {PROBLEMS} problems"),
    );
    say(
        violated == 0,
        "no plan violates anything",
        format!("{violated} violations"),
    );
}

fn effort(idgs: &Curves, others: &[Curves], steps: usize) {
    for (other, name) in others.iter().zip(["simple-reward", "random"]) {
        let (least, steps) = (at(&other.score, steps), steps as f64);
        let share = operations_to(idgs, least) / (steps * overall(&other.operations));
        println!(
            "     idgs scores what {name} does in the end with {:.0} % of its operations",
            100.0 * share
        );
    }
}

/// Operations of an iteration.
fn each(curves: &Curves) -> f64 {
    overall(&curves.operations) / overall(&curves.iterations)
}
