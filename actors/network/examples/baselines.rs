//! Measures the centralised baselines (`farside_network::mapf`) on the missions that the
//! simulator gives its rovers: how often prioritised planning succeeds, how far the reference gets,
//! and how the coupled search grows.
//!
//!     cargo run --release -p farside-network --example baselines -- [SEEDS] [TRIES] [LIMIT]
//!
//! SEEDS runs each (20), TRIES random orders (10), at most LIMIT expansions of a coupled search
//! (300000).

use std::error::Error;

use farside_network::mapf::{
    CoupledConfig, CoupledError, Mission, Order, Outcome, Plan, Problem, Rules, coupled,
    prioritised, reference,
};
use farside_network::{TeamConfig, WorldConfig, missions};
use farside_worlds::{Endpoints, Roadmap};

const ENDPOINTS: [(&str, Endpoints); 3] = [
    ("alternating", Endpoints::Alternating),
    ("any-to-any", Endpoints::AnyToAny),
    ("west-to-east", Endpoints::WestToEast),
];

struct Options {
    seeds: u64,
    tries: u32,
    limit: u64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut options = Options {
        seeds: 20,
        tries: 10,
        limit: 300_000,
    };
    let mut arguments = std::env::args().skip(1);
    if let Some(seeds) = arguments.next() {
        options.seeds = seeds.parse()?;
    }
    if let Some(tries) = arguments.next() {
        options.tries = tries.parse()?;
    }
    if let Some(limit) = arguments.next() {
        options.limit = limit.parse()?;
    }
    let tries = options.tries;
    println!(
        "success: runs in which prioritised planning serves all, in one order / the best of {tries}"
    );
    println!("served: rovers that one order of it serves; time, path: ratios of the reference");
    for name in Roadmap::builtin_names() {
        let map = Roadmap::builtin(name)?;
        for endpoints in ENDPOINTS {
            println!("\n{name}, {}", endpoints.0);
            println!(
                "rovers  success %   served %   queue position   shortest first   best of {tries}"
            );
            println!(
                "        one  best              time   path      time   path      time   path"
            );
            for rovers in [25, 50, 75, 100] {
                row(&map, endpoints.1, rovers, &options)?;
            }
        }
        println!("\n{name}, alternating: the coupled search, least sum of costs, over all seeds");
        println!(
            "        apart until they meet       all at once                largest  reference's sum"
        );
        println!(
            "rovers  solved    median      most  solved    median      most        group   over the best"
        );
        for rovers in 1..=6 {
            growth(&map, rovers, &options)?;
        }
        let speed_ms = speed(&map, 100, &options)?;
        println!("the reference plans 100 rovers in {speed_ms:.1} ms");
    }
    Ok(())
}

fn problem(
    map: &Roadmap,
    endpoints: Endpoints,
    rovers: u32,
    seed: u64,
) -> Result<Problem<'_>, Box<dyn Error>> {
    let world = WorldConfig {
        endpoints,
        ..WorldConfig::default()
    };
    let missions = missions(&world, map, &TeamConfig::of(rovers), seed)?;
    let missions = missions.into_iter().map(Mission::from).collect();
    Ok(Problem::new(map, missions, Rules::DisappearAtTarget)?)
}

/// A plan that the checker has nothing to say against.
fn checked<'a>(plan: &'a Plan, problem: &Problem<'_>) -> Result<&'a Plan, Box<dyn Error>> {
    match plan.conflicts(problem).first() {
        Some(conflict) => Err(format!("{conflict:?}").into()),
        None => Ok(plan),
    }
}

fn row(
    map: &Roadmap,
    endpoints: Endpoints,
    rovers: u32,
    o: &Options,
) -> Result<(), Box<dyn Error>> {
    let (mut one, mut best, mut served) = (0, 0, 0);
    let mut ratios = [(0.0, 0.0); 3];
    for seed in 1..=o.seeds {
        let problem = problem(map, endpoints, rovers, seed)?;
        let tries = o.tries;
        let random = Order::Random { tries, seed };
        let success = |outcome: &Outcome| u32::from(outcome.failures.is_empty());
        let outcome = prioritised(&problem, &Order::QueuePosition);
        one += success(&outcome);
        served += checked(&outcome.plan, &problem)?.metrics(&problem).arrived;
        best += success(&prioritised(&problem, &random));
        let orders = [Order::QueuePosition, Order::ShortestFirst, random];
        for (order, (time, path)) in orders.iter().zip(&mut ratios) {
            let outcome = reference(&problem, order);
            let metrics = checked(&outcome.plan, &problem)?.metrics(&problem);
            assert_eq!(
                metrics.arrived, rovers as usize,
                "the reference never fails"
            );
            *time += metrics.time_ratio;
            *path += metrics.path_ratio;
        }
    }
    let n = o.seeds as f64;
    let percent = |count: u32| 100.0 * f64::from(count) / n;
    let served = 100.0 * served as f64 / (n * f64::from(rovers));
    print!(
        "{rovers:6}  {:3.0}  {:4.0}  {served:8.1}",
        percent(one),
        percent(best)
    );
    for (time, path) in ratios {
        print!("     {:5.2}  {:5.2}", time / n, path / n);
    }
    println!();
    Ok(())
}

/// Expansions over all seeds: rovers planned apart until they meet, and all at once.
fn growth(map: &Roadmap, rovers: u32, o: &Options) -> Result<(), Box<dyn Error>> {
    let (mut apart, mut at_once) = (Vec::new(), Vec::new());
    let (mut largest, mut over) = (0, 0.0);
    for seed in 1..=o.seeds {
        let problem = problem(map, Endpoints::Alternating, rovers, seed)?;
        for (independence, expansions) in [(true, &mut apart), (false, &mut at_once)] {
            let config = CoupledConfig {
                max_expansions: o.limit,
                independence,
                ..CoupledConfig::default()
            };
            match coupled(&problem, &config) {
                Ok(found) => {
                    checked(&found.plan, &problem)?;
                    expansions.push(found.expansions);
                    if independence {
                        let size = found.groups.iter().map(Vec::len).max();
                        largest = largest.max(size.unwrap_or(0));
                        let outcome = reference(&problem, &Order::QueuePosition);
                        let sum = outcome.plan.metrics(&problem).sum_of_costs;
                        over += sum as f64 / found.cost.max(1) as f64;
                    }
                }
                Err(CoupledError::Exhausted { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
    let over = over / apart.len().max(1) as f64;
    let (apart, at_once) = (spread(apart, o), spread(at_once, o));
    println!("{rovers:6}{apart}{at_once}  {largest:11}  {over:18.3}");
    Ok(())
}

/// How many were solved, and the median and the most of what it took.
fn spread(mut expansions: Vec<u64>, o: &Options) -> String {
    let solved = expansions.len();
    // Those that were given up would have needed more.
    expansions.resize(o.seeds as usize, u64::MAX);
    expansions.sort_unstable();
    let tell = |at: usize| match expansions.get(at) {
        Some(&u64::MAX) => format!(">{}", o.limit),
        Some(count) => count.to_string(),
        None => String::new(),
    };
    let (median, most) = (
        tell(expansions.len() / 2),
        tell(expansions.len().wrapping_sub(1)),
    );
    format!("  {solved:6}  {median:>8}  {most:>8}")
}

/// How long one plan of the reference takes, in milliseconds of this machine.
#[allow(
    clippy::disallowed_types,
    reason = "measures the planner, which has no clock"
)]
fn speed(map: &Roadmap, rovers: u32, o: &Options) -> Result<f64, Box<dyn Error>> {
    let mut total_s = 0.0;
    for seed in 1..=o.seeds {
        let problem = problem(map, Endpoints::Alternating, rovers, seed)?;
        let start = std::time::Instant::now();
        reference(&problem, &Order::QueuePosition);
        total_s += start.elapsed().as_secs_f64();
    }
    Ok(1e3 * total_s / o.seeds as f64)
}
