//! Network-guided navigation: sensor nodes plan the paths of rovers on a roadmap, with messages.
//!
//! The algorithm is that of Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning for
//! Resource-Constrained Planetary Rovers*, here called *network-guided*. In each planning cycle the
//! nodes exchange who is where, propose candidate paths, agree on an assignment by max-plus, and
//! send rovers on by one vertex. The paper's messages arrive at once and in order, and its
//! guarantee against collisions rests on that. Here they are late or lost, so that a safety
//! protocol of its own stands below the algorithm: a rover enters a vertex only when the vertex's
//! owner has granted it, and an owner grants only what is proved to be free.
//!
//! ```
//! use std::sync::Arc;
//! use farside::prelude::*;
//! use farside_network::{
//!     Missions, NetworkConfig, Parts, TeamConfig, WorldConfig, assemble_over, missions,
//! };
//! use farside_worlds::Roadmap;
//!
//! let (world, seed) = (WorldConfig::default(), 1);
//! let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name())?);
//! let (team, network) = (TeamConfig::of(3), NetworkConfig::default());
//! let parts = Parts::placed(&world, roadmap, &network, seed)?;
//! let missions = Missions::Queued(missions(&world, &parts.roadmap, &team, seed)?);
//! let mut sim = Simulation::new(seed);
//! let wire = FixedDelay::new(SimDuration::from_millis(5));
//! let system = assemble_over(&mut sim, &parts, &missions, |_, _| wire.clone())?;
//! let report = sim.run(Executor::Inline)?;
//! assert_eq!(report.end.detail(), "@control: all rovers have arrived");
//! let metrics = system.metrics();
//! assert_eq!((metrics.arrived, metrics.collisions), (3, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Readings
//!
//! The paper leaves much open; what was chosen is a key of [`NetworkConfig`], with its reason. Two
//! choices decide how well the algorithm does. C, which the paper calls an estimate of the longest
//! path, is 20 diameters: with one or two, waiting is nearly as good as driving, and nearly every
//! team of 50 gets stuck. And a rover that stands on a leaf of its node's local
//! neighbourhood graph has a path of length 0 to that leaf
//! ([`leaf_wait_penalty`](MaxPlusConfig::leaf_wait_penalty)): without it two rovers that meet at a
//! pocket push each other in and out of it for ever, because the zero path is worth nothing.
//!
//! The paper's step 5 and its request to the owner of the next vertex are one message here
//! ([`messages::Assignments`]), and the owner's grant goes to the rover itself. A request that
//! comes too late to be weighed against others is granted if the vertex is free.
//!
//! # Starved processors
//!
//! The paper's Table 1 is about processors as much as about paths. With all the computing that it
//! asks for (`network.max_plus.processor = "unlimited"`), max-plus converges, and hardly a team
//! gets stuck on the dense roadmap with 21 or 28 nodes. The paper stopped it after 500 ms
//! of a core of 2006. With one constant for all cells, `network.max_plus.processor = "paper"`
//! ([`PAPER_SPEED`], the default), its pattern appears: teams get stuck sooner with
//! fewer nodes, which compare more and longer candidate paths. With fewer than three iterations in
//! a cycle nearly all do.
//!
//! # Spreading the load
//!
//! Section 5 (iii) of the paper asks what could be done where rovers gather and few nodes have all
//! the computing. Three answers can be switched on. A node with more than it can compute has
//! neighbours compute for it ([`outsourcing`](MaxPlusConfig::outsourcing)); rovers are led round
//! crowds ([`congestion_weight`](MaxPlusConfig::congestion_weight)); vertices are divided among
//! nodes more evenly ([`ownership`](WorldConfig::ownership)). Teams in 16 that came to a
//! stop (`stuck`), in per cent; dense roadmap, links of 5 ms; `farside study
//! network/load-balancing --seeds 16 --set network.livelock_window=150` repeats it:
//!
//! | rovers, nodes | 75, 21 | 100, 28 | 100, 21 | 75, 14 |
//! |---|---|---|---|---|
//! | as it comes | 31 | 50 | 94 | 100 |
//! | outsourcing | 0 | 12 | 81 | 94 |
//! | weight 30 | 0 | 31 | | |
//! | weight 30, spread 0.5 | 0 | 19 | 75 | 100 |
//! | outsourcing and weight 30 | 0 | 0 | 50 | 75 |
//! | `balanced` | 6 | 12 | 88 | 94 |
//! | gates | 0 | 0 | 0 | 25 |
//! | gates and outsourcing | | | 0 | 0 |
//!
//! Each helps where some nodes have too much to do and others have not. Where all have, nobody is
//! there to hand work to, and what helps is to let fewer rovers in:
//! [`entry_gates`](MaxPlusConfig::entry_gates). With them loads are uneven again, and outsourcing
//! does the rest. A weight of 100 is too much: detours of a third. To divide vertices by expected
//! traffic (`traffic`) does less than to count them. Study `network/load-balancing`.
//!
//! # Where what is
//!
//! `node` and `rover` are the actors. A node consists of what all nodes share and of a state
//! machine for its policy: `node::max_plus`, `node::complete`, `node::planned`; a new policy is a
//! new file there. What state machines work with knows nothing of actors: `max_plus` (local
//! neighbourhood graph, candidate paths, payoffs, the solver), [`reservation`] (tables, requests),
//! [`mapf`] (plans for whole teams, which `baseline` hands to the planned policies), `motion` (how
//! long an edge takes). Below all policies stand `safety` (what owners and rovers keep, and why no
//! two rovers meet), `failover` (who answers for a node that has fallen silent) and `gaps` (where
//! nobody hears a rover). [`messages`] lists what is said, each declared with its part.
//!
//! Outside of the protocol: `monitor` and `metrics` (what a run amounts to), `waits` and `tracks`
//! (who waits for whom, who was where), `picture` and `scene`; `system`, `scenario`, `config` and
//! `world` (what scenarios say).

mod account;
mod assemble;
mod baseline;
mod builtin;
pub mod cases;
mod config;
mod error;
mod failover;
mod gaps;
mod ids;
pub mod mapf;
mod max_plus;
pub mod messages;
mod metrics;
mod missions;
mod monitor;
mod motion;
mod node;
#[cfg(test)]
mod open_tests;
mod picture;
mod place;
pub mod reservation;
mod rover;
mod safety;
mod scenario;
mod scene;
mod shared;
mod system;
#[cfg(test)]
mod testing;
mod timing;
mod tracks;
mod waits;
mod world;

pub use assemble::{Missions, Network, Parts, assemble, assemble_over};
pub use config::{
    ConfigError, Gaps, Motion, NetworkConfig, Policy, RoadmapSource, Sabotage, TeamConfig,
    WorldConfig,
};
pub use error::NetworkError;
pub use max_plus::candidates::{CandidatePath, Destination, FirstStep};
pub use max_plus::config::{Backtrack, MaxPlusConfig, Priority};
pub use max_plus::processor::PAPER_SPEED;
pub use metrics::{Costs, Deadlock, NetworkMetrics, NoProgress, Outcome};
pub use missions::missions;
pub use node::Node;
pub use reservation::config::CompleteConfig;
pub use rover::Rover;
pub use system::NetworkSystem;
pub use timing::Timing;
