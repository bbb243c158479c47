//! tmp
use farside::random::RandomKey;
use farside_misus::planner::casper::PlannerConfig;
use farside_misus::planner::instance::Instance;
use farside_misus::planner::lns::{LnsConfig, plan};
use farside_misus::planner::problem::{ProblemConfig, generate};
use farside_misus::planner::rounds;

fn main() {
    let a: Vec<u64> = std::env::args()
        .skip(1)
        .map(|x| x.parse().unwrap())
        .collect();
    for seed in a[0]..a[1] {
        let problem = generate(
            &ProblemConfig {
                rocks_least: a[2] as u32,
                rocks_most: a[2] as u32,
                ..Default::default()
            },
            seed,
        )
        .unwrap();
        let instance = Instance::new(&problem).unwrap();
        let i = rounds::run(
            &problem,
            &instance,
            &PlannerConfig::default(),
            RandomKey::new(seed),
        )
        .unwrap();
        print!("{seed} idgs {} lns", i.score[19]);
        for k in 0..3 {
            let f = plan(
                &instance,
                &LnsConfig {
                    operations: a[3],
                    ..Default::default()
                },
                RandomKey::new(k),
            )
            .unwrap();
            print!(" {}", f.score);
            if k == 0 {
                print!(
                    " {:?}",
                    f.history.iter().filter(|h| h.1 > 0.97 * f.score).next()
                );
            }
        }
        println!();
    }
}
