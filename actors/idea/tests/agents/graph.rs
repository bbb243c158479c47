//! Graphs of agents whose models hand goals on: from each incoming register to some outgoing ones.

use std::fmt::Write as _;
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::{Processor, Speed};
use farside_idea::agent::{Agent, AgentSetup, Mind};
use farside_idea::register::Backoff;
use farside_idea::runner::{RegisterSetup, RunnerSettings, Side};
use farside_idea::service::temporal::{Temporal, TemporalOptions};
use farside_planning::language::{Options, read_model};
use farside_planning::model::Model;

use crate::plant::{Pace, Plant};

/// An agent of a graph.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    /// λ.
    pub(crate) latency: SimDuration,
    /// How much of its latency a cycle takes, in thousandths.
    pub(crate) load: u64,
    /// Which of its outgoing registers each incoming one hands its goals on to. The status of a goal
    /// is that of the first of them.
    pub(crate) hands_on: Vec<Vec<usize>>,
}

/// Where an outgoing register leads.
#[derive(Clone, Copy, Debug)]
pub(crate) enum To {
    /// To an incoming register of an agent.
    Agent(usize, usize),
    /// To a plant of its own.
    Plant,
}

/// A graph: for each agent, where its outgoing registers lead.
#[derive(Clone, Debug)]
pub(crate) struct Graph {
    pub(crate) nodes: Vec<Node>,
    pub(crate) leads: Vec<Vec<To>>,
    /// By agent: what its name begins with.
    pub(crate) names: Vec<String>,
    /// The delay of every link.
    pub(crate) delay: SimDuration,
    pub(crate) pace: Pace,
}

/// The model of an agent with so many incoming and outgoing registers.
pub(crate) fn model(node: &Node) -> Arc<Model> {
    let downs: usize = node.hands_on.iter().map(Vec::len).sum();
    let list = |name: &str, count: usize| {
        (0..count)
            .map(|at| format!(" {name}{at}_SV"))
            .collect::<String>()
    };
    let (ups, below) = (list("Up", node.hands_on.len()), list("Down", downs));
    let mut text = format!(
        "(Define_Model agent :profile executive)
(Define_Object_Class Agent :state_variables ((Goal{ups}) (Executable{below})))
(Define_Type Status (ok failed TIMEOUT PREEMPTED FAULT))
(Define_Predicate Idle ())
(Define_Predicate Go ((Number ?x) -> (Status ?status)))\n"
    );
    for name in ups.split_whitespace().chain(below.split_whitespace()) {
        let _ = writeln!(
            text,
            "(Define_Member_Values (Agent {name}) (Idle Go) :default (Idle ()))"
        );
    }
    for (up, hands_on) in node.hands_on.iter().enumerate() {
        let each: String = hands_on
            .iter()
            .map(|down| {
                format!(" (starts (SINGLE ((Agent Down{down}_SV) ((Go (?x -> ?s{down}))))))")
            })
            .collect();
        let first = hands_on[0];
        // A goal ends with its first part, if it has not been replaced in the same cycle.
        let _ = writeln!(
            text,
            "(Define_Compatibility
 (SINGLE ((Agent Up{up}_SV) ((Go (?x -> ?status)))))
 :duration_bounds [1 1000000]
 :compatibility_spec (AND{each}))
(Define_Compatibility
 (SINGLE ((Agent Down{first}_SV) ((Go (?x -> ?status)))))
 :when (!= ?status PREEMPTED)
 :compatibility_spec
 (OR (ends :condition (SINGLE ((Agent Up{up}_SV) ((Go (?x -> ?status)))))) (AND)))"
        );
    }
    for down in 0..downs {
        let _ = writeln!(
            text,
            "(Define_Compatibility
 (SINGLE ((Agent Down{down}_SV) ((Go))))
 :duration_bounds [1 100000])"
        );
    }
    let model = read_model("agent.ddl", &text, &Options::default()).ok();
    Arc::new(model.unwrap_or_else(|findings| panic!("{findings}\n{text}")))
}

impl Graph {
    pub(crate) fn agent_name(&self, at: usize) -> String {
        format!("{}agent_{at}", self.names[at])
    }

    /// The name of a register: who controls it, and which of its outgoing ones it is.
    pub(crate) fn register(from: &str, down: usize) -> String {
        format!("{from}.{down}")
    }

    /// Declares all of it. `ground` are the incoming registers that somebody else controls: the agent,
    /// its register, and that somebody's name.
    pub(crate) fn declare(
        &self,
        sim: &mut Simulation,
        ground: &[(usize, usize, &str, HostId)],
    ) -> Vec<HostId> {
        let hosts: Vec<HostId> = (0..self.nodes.len())
            .map(|at| sim.host(&self.agent_name(at)))
            .collect();
        for (at, node) in self.nodes.iter().enumerate() {
            self.declare_agent(sim, at, node, &hosts, ground);
        }
        hosts
    }

    fn declare_agent(
        &self,
        sim: &mut Simulation,
        at: usize,
        node: &Node,
        hosts: &[HostId],
        ground: &[(usize, usize, &str, HostId)],
    ) {
        let (name, model) = (self.agent_name(at), model(node));
        let timeline = |name: String| {
            model
                .timelines
                .iter()
                .position(|one| one.name == name)
                .expect("it is declared")
        };
        let mut peers: Vec<String> = Vec::new();
        let mut registers = Vec::new();
        let mut register = |name: String, timeline, side, peer: String| {
            let known = peers.iter().position(|one| *one == peer);
            let peer = known.unwrap_or_else(|| {
                peers.push(peer);
                peers.len() - 1
            });
            let lease = SimDuration::ZERO;
            registers.push(RegisterSetup {
                name: name.into(),
                timeline,
                side,
                peer,
                lease,
                is_polled: false,
            });
        };
        let both_ways = |sim: &mut Simulation, b: HostId, other: &str| {
            let a = hosts[at];
            for (from, to, names) in [(a, b, [&*name, other]), (b, a, [other, &*name])] {
                sim.link(from, to, &names.join("-"), FixedDelay::new(self.delay));
            }
        };
        for (down, to) in self.leads[at].iter().enumerate() {
            let peer = match to {
                To::Agent(other, _) => {
                    let peer = self.agent_name(*other);
                    both_ways(sim, hosts[*other], &peer);
                    peer
                }
                To::Plant => {
                    let plant = format!("{name}/plant_{down}");
                    let host = sim.host(&plant);
                    both_ways(sim, host, &plant);
                    let (agent, pace) = (name.clone(), self.pace);
                    sim.actor(host, &plant, move |_| Plant::new(&agent, pace, BACKOFF));
                    plant
                }
            };
            let at = timeline(format!("Down{down}_SV"));
            register(Graph::register(&name, down), at, Side::Controlling, peer);
        }
        for up in 0..node.hands_on.len() {
            let at_up = timeline(format!("Up{up}_SV"));
            let from_ground = ground.iter().find(|one| (one.0, one.1) == (at, up));
            let (controller, down) = match from_ground {
                Some((.., name, host)) => {
                    both_ways(sim, *host, name);
                    ((*name).to_owned(), 0)
                }
                None => self.controller_of(at, up),
            };
            let name = Graph::register(&controller, down);
            register(name, at_up, Side::Controlled, controller);
        }
        // What planning takes is small beside the overhead, which is the load that is wanted.
        let overhead = node.load * node.latency.as_nanos() / 1000;
        let setup = AgentSetup {
            runner: RunnerSettings {
                latency: node.latency,
                horizon: 1,
                budget: 1_000_000,
                overhead,
                aborts: 0,
                backoff: BACKOFF,
                forgets: true,
            },
            registers,
            peers,
            mind: Arc::new(move || Mind {
                service: Box::new(
                    Temporal::new(model.clone(), TemporalOptions::default()).expect("it fits"),
                ),
                deliberator: None,
            }),
            // Without a load decisions leave with the tick itself.
            processor: Processor::new(match node.load {
                0 => Speed::Unlimited,
                _ => Speed::PerS(1_000_000_000),
            }),
            restart_after: SimDuration::ZERO,
        };
        setup.check().expect("it is right");
        let setup = Arc::new(setup);
        sim.actor(hosts[at], &name, move |_| Agent::new(setup.clone()));
    }

    /// The name of an agent's incoming register.
    pub(crate) fn controls(&self, at: usize, up: usize) -> String {
        if (at, up) == (0, 0) {
            return Graph::register("ground", 0);
        }
        let (controller, down) = self.controller_of(at, up);
        Graph::register(&controller, down)
    }

    /// The agents that a goal passes on its way from the first one to the plant behind a register; none
    /// if there is no plant behind it. Agents beside each other have rows of their own: what one of them
    /// hands on does not wait for the others, and may not be measured by them.
    pub(crate) fn row_to(&self, register: &str) -> Option<Vec<usize>> {
        let (mut at, mut down) = self.plant_behind(register)?;
        let mut row = vec![at];
        while at != 0 {
            let mut ups = self.nodes[at].hands_on.iter();
            let up = ups.position(|hands_on| hands_on.contains(&down));
            (at, down) = self.leads_to(at, up.expect("a goal is handed on to it"));
            row.push(at);
        }
        row.reverse();
        Some(row)
    }

    /// The agent and its outgoing register of a name, if it leads to a plant.
    fn plant_behind(&self, register: &str) -> Option<(usize, usize)> {
        let mut all = (0..self.nodes.len())
            .flat_map(|at| (0..self.leads[at].len()).map(move |down| (at, down)));
        all.find(|&(at, down)| {
            matches!(self.leads[at][down], To::Plant)
                && Graph::register(&self.agent_name(at), down) == register
        })
    }

    fn controller_of(&self, at: usize, up: usize) -> (String, usize) {
        let (other, down) = self.leads_to(at, up);
        (self.agent_name(other), down)
    }

    /// The agent and its outgoing register that lead to an incoming register of an agent.
    fn leads_to(&self, at: usize, up: usize) -> (usize, usize) {
        for (other, leads) in self.leads.iter().enumerate() {
            for (down, to) in leads.iter().enumerate() {
                if matches!(to, To::Agent(a, u) if (*a, *u) == (at, up)) {
                    return (other, down);
                }
            }
        }
        panic!("nobody controls register {up} of agent {at}");
    }
}

pub(crate) const BACKOFF: Backoff = Backoff {
    first: SimDuration::from_secs(10),
    most: SimDuration::from_secs(60),
};
