//! Actors of a run live again, and all else comes from its record: they do what they did, and a change of one is
//! seen.

use std::path::Path;

use farside::prelude::*;
use farside::replay::Replay;
use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use farside_logs::{Log, LogOptions, LogWriter, ReplayOutcome, again, charges_in};
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

use crate::determinism::chatter;

/// Replays on the records of the run while it goes on.
fn beside(build: impl Fn() -> Simulation, live: impl Fn(&str) -> bool) -> ReplayOutcome {
    let replay = Replay::new(build(), live).unwrap();
    let mut sim = build();
    let again = again(&mut sim, replay);
    sim.run(Executor::Inline).unwrap();
    again.outcome().unwrap()
}

fn log(mut sim: Simulation, path: &Path) {
    let writer = LogWriter::create(path, LogOptions::default()).unwrap();
    sim.observe(writer);
    sim.run(Executor::Inline).unwrap();
}

/// Replays from a log; none if what links charged is asked for, and the log does not say when.
fn from_log(
    path: &Path,
    build: impl Fn() -> Simulation,
    live: impl Fn(&str) -> bool,
) -> Option<ReplayOutcome> {
    let replay = |charges: &[_]| {
        let replay = Replay::new(build(), &live).unwrap();
        farside_logs::replay(&Log::open(path).unwrap(), replay, charges).unwrap()
    };
    let outcome = replay(&[]);
    if !outcome.needs_charges {
        return Some(outcome);
    }
    let beside = Replay::new(build(), &live).unwrap();
    let charges = charges_in(&Log::open(path).unwrap(), &beside).unwrap()?;
    Some(replay(&charges))
}

fn is_as_recorded(outcome: &ReplayOutcome) -> Result<(), TestCaseError> {
    prop_assert_eq!(outcome.differing(), 0, "{:#?}", outcome);
    prop_assert_eq!(outcome.steps, outcome.recorded_steps, "{:#?}", outcome);
    // As many in each tick.
    prop_assert_eq!(outcome.differing_instants, 0, "{:#?}", outcome);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    /// Crashes, restarts, ties, tells, stops, faults, copies, links that hold and are shared, charges: an actor,
    /// or several, does what it did.
    #[test]
    fn actors_of_a_random_model_do_what_they_did(
        model in chatter(),
        which in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
    ) {
        let sim = model.build();
        let names: Vec<&str> = sim.actor_names().collect();
        let live: Vec<&str> = which.iter().map(|index| *index.get(&names)).collect();
        let is_live = |name: &str| live.contains(&name);
        is_as_recorded(&beside(|| model.build(), is_live))?;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        log(model.build(), &path);
        if let Some(outcome) = from_log(&path, || model.build(), is_live) {
            is_as_recorded(&outcome)?;
        }
    }
}

fn scenario(name: &str, sets: &[&str]) -> Scenario {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    Scenario::open(name, &sets, &Registry::builtin()).unwrap()
}

/// Of every built-in scenario, cut short, some actors alone: one of each role, as names have it.
#[test]
fn actors_of_built_in_scenarios_do_what_they_did() {
    for name in Registry::builtin().scenario_names() {
        let sets: &[&str] = match name {
            "traffic/contact-plan" => &["until=1h"],
            "misus/planners" => &["until=1h"],
            _ if name.starts_with("misus/") => &["until=2h", "learn.exchange_every=10min"],
            // Its gaps are where few rovers could not go.
            "network/crater-gaps" => &["until=6s"],
            _ if name.starts_with("network/") => &["until=6s", "team.rovers=8"],
            _ => &["until=20s"],
        };
        let scenario = scenario(name, sets);
        let build = || scenario.assemble().unwrap().sim;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let sim = build();
        let mut roles: Vec<(String, String)> = Vec::new();
        for actor in sim.actor_names() {
            let role: String = actor.chars().filter(|c| !c.is_ascii_digit()).collect();
            if !roles.iter().any(|(known, _)| *known == role) {
                roles.push((role, actor.to_owned()));
            }
        }
        log(sim, &path);
        for (_, actor) in roles {
            let is_live = |other: &str| other == actor;
            let outcome = from_log(&path, build, is_live);
            let outcome = outcome.unwrap_or_else(|| beside(build, is_live));
            let differs = is_as_recorded(&outcome);
            assert!(differs.is_ok(), "{name} {actor}: {differs:?}");
            assert!(outcome.steps > 0, "{name} {actor} did nothing");
        }
    }
}

/// Keeps a distance by a gain, on noisy readings.
struct Follower {
    leader: Recipient<Speed>,
    gain: f64,
}

#[derive(Serialize, Deserialize)]
struct Distance {
    metres: f64,
}

#[derive(Serialize, Deserialize)]
struct Speed {
    metres_per_s: f64,
    number: u32,
}

#[derive(Serialize, Deserialize)]
struct Tick;

impl Actor for Follower {
    type Accepts = (Distance,);
}

impl Handler<Distance> for Follower {
    fn handle(&mut self, seen: Distance, ctx: &mut Context<'_, Self>) -> Outcome {
        let noise = ctx.random("reading").normal(0.0, 0.01);
        let number = ctx.durable::<u32>();
        *number += 1;
        let number = *number;
        let metres_per_s = self.gain * (seen.metres + noise - 2.0);
        ctx.send(
            self.leader,
            Speed {
                metres_per_s,
                number,
            },
        );
        Ok(())
    }
}

/// Measures every second.
struct Sensor {
    metres: f64,
}

impl Actor for Sensor {
    type Accepts = (Tick, Speed);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Tick);
        Ok(())
    }
}

impl Handler<Tick> for Sensor {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        let follower = ctx.recipient::<Distance>("follower")?;
        ctx.send(
            follower,
            Distance {
                metres: self.metres,
            },
        );
        ctx.timer(SimDuration::from_secs(1), Tick);
        Ok(())
    }
}

impl Handler<Speed> for Sensor {
    fn handle(&mut self, speed: Speed, _ctx: &mut Context<'_, Self>) -> Outcome {
        self.metres -= speed.metres_per_s;
        Ok(())
    }
}

fn following(gain: f64) -> Simulation {
    let mut sim = Simulation::new(5);
    let (front, back) = (sim.host("front"), sim.host("back"));
    let sensor = sim.actor(front, "sensor", |_| Sensor { metres: 5.0 });
    let leader = sensor.recipient::<Speed>();
    sim.actor(back, "follower", move |_| Follower { leader, gain });
    let way = FixedDelay::new(SimDuration::from_millis(10));
    sim.link(front, back, "front-back", way.clone());
    sim.link(back, front, "back-front", way);
    sim.crash_named_at(SimTime::from_secs(20), "follower")
        .unwrap();
    sim.restart_named_at(SimTime::from_secs(23), "follower")
        .unwrap();
    sim.stop_at(SimTime::from_secs(60), "a minute");
    sim
}

/// What people want of it: one node on its recorded inputs, and a deliberate change of a gain, named by its
/// first diverging field and time.
#[test]
fn a_change_of_a_gain_is_seen_where_it_first_shows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    log(following(0.2), &path);
    let replayed = |gain: f64| {
        let replay = Replay::new(following(gain), |name| name == "follower").unwrap();
        farside_logs::replay(&Log::open(&path).unwrap(), replay, &[]).unwrap()
    };
    let same = replayed(0.2);
    assert_eq!((same.same, same.differing()), (56, 0), "{same:#?}");
    assert_eq!((same.steps, same.recorded_steps), (58, 58));
    let other = replayed(0.25);
    assert_eq!((other.same, other.changed), (0, 56), "{other:#?}");
    let first = other.first.unwrap();
    assert_eq!(first.time_ns, 1_010_000_000);
    assert_eq!(
        (first.actor.as_str(), first.kind.as_str()),
        ("follower", "Speed")
    );
    assert_eq!(first.field, "body.metres_per_s");
    let cause = first.cause.unwrap();
    assert_eq!((cause.kind.as_str(), cause.ordinal), ("Distance", 0));
}

/// Rovers that restart with other settings in mid-run do so in a replay.
#[test]
fn actors_of_a_fork_are_built_as_they_were() {
    let text = r#"
system = "network"
seed = 3
until = "9s"
[world]
roadmap = "crater-sparse"
nodes = 28
[team]
rovers = 6
[[crash]]
actor = "node_02"
at = "1s"
restart = "3s"
[[fork]]
at = "5s"
set = ["network.max_plus.noise=0.2"]
"#;
    let files = Files::on_disk(std::path::PathBuf::new());
    let scenario = Scenario::parse(
        "fork.toml",
        text.to_owned(),
        &[],
        &Registry::builtin(),
        files,
    );
    let scenario = scenario.unwrap();
    let build = || scenario.assemble().unwrap().sim;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    log(build(), &path);
    for live in ["node_02", "node_11", "rover_03"] {
        let outcome = from_log(&path, build, |name| name == live).unwrap();
        assert!(is_as_recorded(&outcome).is_ok(), "{live}: {outcome:#?}");
    }
    let nodes = from_log(&path, build, |name| name.starts_with("node_")).unwrap();
    assert!(is_as_recorded(&nodes).is_ok(), "{nodes:#?}");
}
