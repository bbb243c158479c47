//! The paper's Figures 3, 4 and 5 and its traverse.
use farside::random::RandomKey;
use farside_misus::planner::casper::{Choice, PlannerConfig};
use farside_misus::planner::instance::Instance;
use farside_misus::planner::problem::{ProblemConfig, generate};
use farside_misus::planner::rounds::{Rounds, run};

fn main() {
    let mut all: Vec<Vec<Rounds>> = vec![Vec::new(), Vec::new(), Vec::new()];
    for p in 0..30 {
        let problem = generate(&ProblemConfig::default(), p).unwrap();
        let instance = Instance::new(&problem).unwrap();
        for r in 0..5 {
            for (k, choice) in [Choice::Idgs, Choice::SimpleReward, Choice::Random]
                .into_iter()
                .enumerate()
            {
                let config = PlannerConfig {
                    choice,
                    ..Default::default()
                };
                all[k]
                    .push(run(&problem, &instance, &config, RandomKey::new(p).number(r)).unwrap());
            }
        }
    }
    for step in [1, 2, 3, 5, 10, 15, 20] {
        print!("{step:3}");
        for f in [
            |r: &Rounds, at: usize| r.score[at],
            |r: &Rounds, at: usize| r.goals[at],
            |r: &Rounds, at: usize| r.traverse_m[at],
            |r: &Rounds, at: usize| r.operations[at],
            |r: &Rounds, at: usize| r.iterations[at],
            |r: &Rounds, _: usize| r.operations.iter().sum::<f64>() / 20.0,
            |r: &Rounds, _: usize| r.iterations.iter().sum::<f64>() / 20.0,
        ] {
            for k in 0..3 {
                let m = all[k].iter().map(|r| f(r, step - 1)).sum::<f64>() / 150.0;
                print!(" {m:8.1}");
            }
            print!(" |");
        }
        println!();
    }
    for k in 0..3 {
        println!(
            "shed {} re {} del {}",
            all[k].iter().map(|r| r.shed).sum::<u64>() / 150,
            all[k].iter().map(|r| r.reassigned).sum::<u64>() / 150,
            all[k].iter().map(|r| r.deleted.len()).sum::<usize>() as f64 / 150.0
        );
    }
}
