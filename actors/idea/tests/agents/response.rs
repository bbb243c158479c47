//! Section 2 of the paper: an agent answers within 2λ; agents in a row within the sum of theirs and the
//! links' delays.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_idea::register::{ContractEnd, RegisterLoad, RegisterStatus, RegisterValue};
use proptest::prelude::*;

use crate::graph::{Graph, Node, To};
use crate::ground::Ground;
use crate::plant::Pace;

/// When messages with goals left and arrived, as a run's records have it.
#[derive(Default, Debug)]
struct Times {
    /// By register and goal: when a load of it first arrived.
    asked: BTreeMap<(String, i64), SimTime>,
    /// By register and goal: when a load of it was first sent.
    handed_on: BTreeMap<(String, i64), SimTime>,
    /// By register and number: the goal.
    goals: BTreeMap<(String, u32), i64>,
    /// By register and goal: when the status that ends it first arrived.
    told: BTreeMap<(String, i64), SimTime>,
    /// By register and goal: when that status was first sent.
    answered: BTreeMap<(String, i64), SimTime>,
}

struct Watch(Arc<Mutex<Times>>);

impl Observer for Watch {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: false,
            checkpoints: false,
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let Some(kind) = record.kind else {
            return Ok(Flow::Continue);
        };
        if record.class != RecordClass::Delivered {
            return Ok(Flow::Continue);
        }
        let mut times = self.0.lock().expect("nobody panics");
        match kind.name() {
            "RegisterLoad" => {
                let load: RegisterLoad = kind.schema().decode(record.body).expect("it is one");
                let Some(RegisterValue::Number(goal)) = load.inputs.first() else {
                    return Ok(Flow::Continue);
                };
                let register = load.register.to_string();
                times.goals.insert((register.clone(), load.number), *goal);
                let key = (register, *goal);
                times.asked.entry(key.clone()).or_insert(record.time());
                times.handed_on.entry(key).or_insert(record.sent);
            }
            "RegisterStatus" => {
                let status: RegisterStatus = kind.schema().decode(record.body).expect("it is one");
                let register = status.register.to_string();
                let goal = times.goals.get(&(register.clone(), status.number)).copied();
                let Some(goal) = goal.filter(|_| status.end == ContractEnd::Ended) else {
                    return Ok(Flow::Continue);
                };
                let key = (register, goal);
                times.told.entry(key.clone()).or_insert(record.time());
                times.answered.entry(key).or_insert(record.sent);
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }
}

/// Runs a graph that the ground commands on the first register of its first agent.
fn run(graph: &Graph, goals: i64, seed: u64, ties: Option<u64>) -> Times {
    let mut sim = Simulation::new(seed);
    sim.tie_seed(ties);
    let host = sim.host("ground");
    let first = graph.agent_name(0);
    graph.declare(&mut sim, &[(0, 0, "ground", host)]);
    let register = Graph::register("ground", 0);
    sim.actor(host, "ground", move |_| {
        Ground::new(&register, &first, goals, SimDuration::from_secs(7))
    });
    let times = Arc::new(Mutex::new(Times::default()));
    sim.observe(Watch(times.clone()));
    sim.stop_at(SimTime::from_secs(3600), "an hour is over");
    let report = sim.run(Executor::Inline).expect("it runs");
    assert_eq!(report.end.name(), "stopped", "{:?}", report.end);
    std::mem::take(&mut *times.lock().expect("nobody panics"))
}

/// The longest answer of each agent, in latencies.
fn answers(graph: &Graph, times: &Times) -> Vec<f64> {
    let mut longest = vec![0.0_f64; graph.nodes.len()];
    let mut note = |at: usize, wait: SimDuration| {
        let latency_s = graph.nodes[at].latency.as_secs_f64();
        longest[at] = longest[at].max(wait.as_secs_f64() / latency_s);
    };
    for at in 0..graph.nodes.len() {
        let name = graph.agent_name(at);
        for (up, hands_on) in graph.nodes[at].hands_on.iter().enumerate() {
            let up = graph.controls(at, up);
            for (place, down) in hands_on.iter().enumerate() {
                let down = Graph::register(&name, *down);
                for ((_, goal), sent) in times.handed_on.iter().filter(|one| one.0.0 == down) {
                    note(at, sent.since(times.asked[&(up.clone(), *goal)]));
                }
                // The status of the first register that a goal was handed on to is the goal's.
                if place > 0 {
                    continue;
                }
                for ((_, goal), sent) in times.answered.iter().filter(|one| one.0.0 == up) {
                    let told = times.told.get(&(down.clone(), *goal));
                    let told = told.unwrap_or_else(|| {
                        panic!("{up} was answered for {goal} at {sent}, before {down}")
                    });
                    note(at, sent.since(*told));
                }
            }
        }
    }
    longest
}

/// Until goals reached the plants of a graph: by the plant's register, how long the slowest of them took
/// from its arrival at the first agent, and what that must be less than.
///
/// An agent reads what has arrived at its next tick, less than or exactly λ later, and hands it on in less
/// than λ after that; then it is on its way for the delay of the link. What is never lost adds no
/// repetition, and no agent waits for an acknowledgement.
fn ways(graph: &Graph, times: &Times) -> BTreeMap<String, (SimDuration, SimDuration)> {
    let mut ways = BTreeMap::new();
    for ((register, goal), &arrived) in &times.asked {
        let Some(row) = graph.row_to(register) else {
            continue;
        };
        let latencies = row.iter().fold(SimDuration::ZERO, |sum, at| {
            sum + graph.nodes[*at].latency * 2
        });
        let most = latencies + graph.delay * row.len() as u64;
        let took = arrived.since(times.asked[&(Graph::register("ground", 0), *goal)]);
        let way = ways.entry(register.clone()).or_insert((took, most));
        way.0 = way.0.max(took);
    }
    ways
}

fn node() -> impl Strategy<Value = (u64, u64)> {
    // λ in ms, and the load in thousandths of it.
    (prop_oneof![Just(500_u64), 100_u64..1500], 0_u64..990)
}

fn graphs() -> impl Strategy<Value = Graph> {
    let shape = prop_oneof![Just("chain"), Just("tree"), Just("diamond")];
    let times_ms = (0_u64..2000, 1_u64..4000, 0_u64..9000);
    let names = proptest::collection::vec("[a-z]", 4);
    (shape, proptest::collection::vec(node(), 4), names, times_ms).prop_map(
        |(shape, nodes, names, (delay_ms, least_ms, more_ms))| Graph {
            names,
            ..graph_of(shape, &nodes, delay_ms, least_ms..least_ms + more_ms)
        },
    )
}

/// A graph of agents with such λ \[ms\] and loads \[thousandths\], and plants that take so long \[ms\].
fn graph_of(shape: &str, nodes: &[(u64, u64)], delay_ms: u64, pace_ms: Range<u64>) -> Graph {
    let (hands_on, leads) = shape_of(shape);
    let nodes = nodes.iter().zip(hands_on);
    let nodes = nodes.map(|(&(latency_ms, load), hands_on)| Node {
        latency: SimDuration::from_millis(latency_ms),
        load,
        hands_on,
    });
    Graph {
        nodes: nodes.collect(),
        names: vec![String::new(); leads.len()],
        leads,
        delay: SimDuration::from_millis(delay_ms),
        pace: Pace {
            least: SimDuration::from_millis(pace_ms.start),
            most: SimDuration::from_millis(pace_ms.end),
        },
    }
}

/// By agent: which outgoing registers incoming ones lead to, and where those lead.
fn shape_of(name: &str) -> (Vec<Vec<Vec<usize>>>, Vec<Vec<To>>) {
    use To::{Agent, Plant};
    let one = || vec![vec![0]];
    match name {
        "chain" => (
            vec![one(), one(), one(), one()],
            vec![
                vec![Agent(1, 0)],
                vec![Agent(2, 0)],
                vec![Agent(3, 0)],
                vec![Plant],
            ],
        ),
        "tree" => (
            vec![vec![vec![0, 1, 2]], one(), one(), vec![vec![0, 1]]],
            vec![
                vec![Agent(1, 0), Agent(2, 0), Agent(3, 0)],
                vec![Plant],
                vec![Plant],
                vec![Plant, Plant],
            ],
        ),
        _ => (
            vec![vec![vec![0, 1]], one(), one(), vec![vec![0], vec![1]]],
            vec![
                vec![Agent(1, 0), Agent(2, 0)],
                vec![Agent(3, 0)],
                vec![Agent(3, 1)],
                vec![Plant, Plant],
            ],
        ),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// No agent of any graph takes 2λ to answer, whatever the order of what happens at one instant.
    #[test]
    fn every_answer_leaves_within_two_latencies(graph in graphs(), seed in 0_u64..1000) {
        for ties in [None, Some(seed)] {
            let times = run(&graph, 12, seed, ties);
            prop_assert!(times.told.len() > 3, "nothing came of it: {times:?}");
            for (at, longest) in answers(&graph, &times).into_iter().enumerate() {
                prop_assert!(longest < 2.0, "agent {at} took {longest} latencies");
            }
        }
    }

    /// From the first agent to each plant: below the sum of 2λ of each agent and the links' delays.
    #[test]
    fn agents_in_a_row_answer_within_the_sum(graph in graphs(), seed in 0_u64..1000) {
        let times = run(&graph, 12, seed, None);
        let ways = ways(&graph, &times);
        let plants = graph.leads.iter().flatten().filter(|to| matches!(to, To::Plant)).count();
        prop_assert_eq!(ways.len(), plants, "no goal came to some plant");
        for (register, (took, most)) in ways {
            prop_assert!(took < most, "{register} took {took} of {most}");
        }
    }
}

/// Of two ways to one agent each has its own sum: the slower one may take longer than the faster one ever
/// could.
#[test]
fn the_slower_way_of_a_diamond_is_not_bound_by_the_faster_one() {
    let nodes = [(750, 856), (500, 784), (100, 0), (500, 289)];
    let graph = graph_of("diamond", &nodes, 108, 53..253);
    let ways = ways(&graph, &run(&graph, 12, 524, None));
    let [slower, faster] = [0, 1].map(|down| ways[&Graph::register("agent_3", down)]);
    assert_eq!(slower.1, SimDuration::from_millis(3824));
    assert_eq!(faster.1, SimDuration::from_millis(3024));
    assert!(faster.0 < faster.1, "{faster:?}");
    assert!((faster.1..slower.1).contains(&slower.0), "{slower:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// What arrives with a tick waits for the next one: whoever is called what, and whichever of two
    /// events of one instant comes first, all is sent at the same times, and nothing is answered at
    /// once.
    #[test]
    fn what_arrives_with_a_tick_waits_for_the_next(
        mut graph in graphs(),
        others in proptest::collection::vec("[a-z]", 4),
        ties in 0_u64..1000,
    ) {
        for node in &mut graph.nodes {
            (node.latency, node.load) = (SimDuration::from_millis(500), 0);
        }
        graph.delay = SimDuration::from_millis(500);
        graph.pace.most = graph.pace.least;
        let first = run(&graph, 8, 1, None);
        prop_assert!(answers(&graph, &first).into_iter().all(|longest| longest < 2.0));
        let other = Graph { names: others, ..graph.clone() };
        let second = run(&other, 8, 1, Some(ties));
        prop_assert_eq!(sorted(&first.handed_on), sorted(&second.handed_on));
        prop_assert_eq!(sorted(&first.answered), sorted(&second.answered));
        for (key, &left) in &first.handed_on {
            let ticks = left.as_nanos() % 500_000_000;
            prop_assert!(key.0.starts_with("ground") || ticks == 0, "{key:?} left at {left}");
        }
    }
}

/// Times by goal alone: agents have other names.
fn sorted(times: &BTreeMap<(String, i64), SimTime>) -> Vec<(i64, SimTime)> {
    let mut all: Vec<_> = times.iter().map(|((_, goal), at)| (*goal, *at)).collect();
    all.sort_unstable();
    all
}

/// The bound is tight: some answer takes more than 1.95λ.
#[test]
fn some_answer_takes_nearly_two_latencies() {
    let graph = graph_of("chain", &[(500, 995); 4], 137, 1..3000);
    let mut longest = 0.0;
    for seed in 0..20 {
        let times = run(&graph, 40, seed, None);
        longest = answers(&graph, &times).into_iter().fold(longest, f64::max);
    }
    assert!((1.95..2.0).contains(&longest), "{longest}");
}
