//! The actors on the kernel, over links that lose every second message, with crashes.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside_actors::link::LinksConfig;
use farside_actors::wiring::{LinkBuilder, Wiring};
use farside_misus::shac::{Centre, GoalKey, Owner, OwnerError, Party, Reason, Settings, Standing};
use farside_misus::sharing::{
    Coordinator, Names, Pursuer, RoverMind, RoverMove, TeamMind, TeamMove,
};

use super::team::{goal, pair};

const GOALS: u32 = 9;

/// Accepts everything, and does one thing after the other. Its hardware outlives its crashes.
struct Diligent {
    hardware: Arc<Mutex<BTreeMap<GoalKey, SimTime>>>,
    wake: SimTime,
}

impl RoverMind for Diligent {
    fn next(
        &mut self,
        now: SimTime,
        owner: &Owner,
        refused: Option<&OwnerError>,
    ) -> Option<RoverMove> {
        assert!(refused.is_none(), "{refused:?}");
        if let Some(offer) = owner.offers().next() {
            return Some(RoverMove::Accept(offer.goal.key));
        }
        let mut hardware = self.hardware.lock().unwrap();
        let held = owner.durable().held.values();
        let started = held.clone().find(|holding| holding.started.is_some());
        if let Some(holding) = started {
            let key = holding.goal.key;
            let Some(ends) = hardware.get(&key).copied() else {
                return Some(RoverMove::Failed(key, Reason::Hardware));
            };
            self.wake = ends;
            return (now >= ends).then_some(RoverMove::Done(key));
        }
        self.wake = SimTime::MAX;
        let next = held
            .clone()
            .find(|holding| owner.may_begin(now, holding.goal.key).is_ok())?;
        hardware.insert(next.goal.key, now + next.goal.parameters.duration);
        Some(RoverMove::Begin(next.goal.key))
    }

    fn wake(&self) -> SimTime {
        self.wake
    }
}

/// Hands each goal to the next rover in turn, and notes how goals stand.
struct InTurn {
    wished: usize,
    next: u32,
    standings: Arc<Mutex<BTreeMap<GoalKey, Standing>>>,
}

impl TeamMind for InTurn {
    fn next(&mut self, now: SimTime, centre: &Centre, refused: Option<&str>) -> Option<TeamMove> {
        assert!(
            refused.is_none() || refused.unwrap().contains("already"),
            "{refused:?}"
        );
        let singles = (0..GOALS).map(goal);
        let goals: Vec<_> = singles.chain(pair(100)).collect();
        if let Some(goal) = goals.get(self.wished) {
            self.wished += 1;
            return Some(TeamMove::Add(*goal));
        }
        *self.standings.lock().unwrap() = centre.standings().collect();
        let vacancy = centre.vacancies(now).into_iter().next()?;
        let count = vacancy.candidates.len();
        self.next += 1;
        let chosen = (0..vacancy.places())
            .map(|place| vacancy.candidates[(self.next as usize + place) % count]);
        Some(TeamMove::Assign(vacancy.goal, chosen.collect()))
    }

    fn wake(&self) -> SimTime {
        SimTime::MAX
    }
}

fn run(executor: Executor) -> (String, BTreeMap<GoalKey, Standing>) {
    let mut sim = Simulation::new(5);
    let settings = Arc::new(Settings::new("lease", 3, &[3]).unwrap());
    let mut names: BTreeMap<Party, String> = (0..3)
        .map(|rover| (Party::Owner(rover), format!("rover_{:02}", rover + 1)))
        .collect();
    names.insert(Party::Centre(3), "lander".to_owned());
    let names: Names = Arc::new(names);
    let standings = Arc::new(Mutex::new(BTreeMap::new()));
    let mut hosts = Vec::new();
    for (&party, name) in names.iter() {
        let host = sim.host(name);
        hosts.push((host, name.as_str()));
        let (settings, names) = (settings.clone(), names.clone());
        match party {
            Party::Owner(rover) => {
                let hardware = Arc::new(Mutex::new(BTreeMap::new()));
                sim.actor(host, name, move |_| {
                    let (hardware, wake) = (hardware.clone(), SimTime::MAX);
                    let mind = Box::new(Diligent { hardware, wake });
                    Pursuer::new(settings.clone(), rover, names.clone(), mind)
                });
            }
            Party::Centre(site) => {
                let standings = standings.clone();
                sim.actor(host, name, move |_| {
                    let standings = standings.clone();
                    let mind = Box::new(InTurn {
                        wished: 0,
                        next: 0,
                        standings,
                    });
                    Coordinator::new(settings.clone(), site, names.clone(), mind)
                });
            }
        }
    }
    let mut wiring = Wiring::default();
    for (number, from) in hosts.iter().enumerate() {
        for to in &hosts[number + 1..] {
            wiring.both_ways(*from, *to);
        }
    }
    let links: LinksConfig =
        toml::from_str("default = { latency = \"200ms\", loss = 0.5 }").unwrap();
    LinkBuilder::new(&links, &[])
        .unwrap()
        .build(&mut sim, &wiring)
        .unwrap();
    let (second, minute) = (SimTime::from_secs, 60);
    for (name, crash, restart) in [("rover_02", 25, 95), ("lander", 40, 70)] {
        sim.crash_named_at(second(crash * minute), name).unwrap();
        sim.restart_named_at(second(restart * minute), name)
            .unwrap();
    }
    sim.stop_at(second(12 * 60 * minute), "half a day is enough");
    let report = sim.run(executor).unwrap();
    let standings = standings.lock().unwrap().clone();
    (report.digest.to_string(), standings)
}

#[test]
fn over_links_that_lose_half_of_all_and_with_crashes_every_goal_is_achieved() {
    let (digest, standings) = run(Executor::Inline);
    assert_eq!(standings.len(), GOALS as usize + 2);
    let is_achieved = |standing: &Standing| *standing == Standing::Achieved;
    assert!(standings.values().all(is_achieved), "{standings:?}");
    let threaded = run(Executor::Kameo { threads: 2 });
    assert_eq!(threaded, (digest, standings));
}
