//! A centre at a lander and some owners, on a network that loses nothing and takes no time.

use std::collections::VecDeque;
use std::sync::Arc;

use farside::{SimDuration, SimTime};
use farside_misus::shac::{
    Centre, CentreDurable, GoalKey, Message, Output, Owner, OwnerDurable, OwnerError, OwnerWrite,
    Party, Settings, SharedGoal,
};

/// The team, at an instant.
pub(crate) struct Team {
    pub(crate) now: SimTime,
    pub(crate) centre: Centre,
    pub(crate) owners: Vec<Owner>,
    /// Rovers that nothing reaches, and from which nothing comes.
    pub(crate) silent: Vec<u32>,
    queue: VecDeque<(Party, Party, Message)>,
    /// All messages that arrived.
    pub(crate) arrived: Vec<(Party, Party, Message)>,
}

pub(crate) fn goal(number: u32) -> SharedGoal {
    let key = GoalKey::Numbered(number);
    SharedGoal::new(key, [f64::from(number), 0.0], SimDuration::from_secs(600))
}

pub(crate) fn pair(number: u32) -> [SharedGoal; 2] {
    let mut halves = [goal(number), goal(number + 1)];
    halves[0].partner = Some(halves[1].key);
    halves[1].partner = Some(halves[0].key);
    halves
}

impl Team {
    pub(crate) fn new(settings: Settings) -> Team {
        settings.check().unwrap();
        let settings = Arc::new(settings);
        let (now, site) = (SimTime::ZERO, settings.candidates[0]);
        let start = |rover| Owner::start(settings.clone(), rover, OwnerDurable::default(), now);
        let (owners, starts): (Vec<Owner>, Vec<_>) = (0..settings.rovers).map(start).unzip();
        let (centre, started) =
            Centre::start(settings.clone(), site, CentreDurable::default(), now);
        let mut team = Team {
            now,
            centre,
            owners,
            silent: Vec::new(),
            queue: VecDeque::new(),
            arrived: Vec::new(),
        };
        team.send(Party::Centre(site), started.sends);
        for (rover, out) in (0..).zip(starts) {
            team.send(Party::Owner(rover), out.sends);
        }
        team.deliver();
        team
    }

    fn send(&mut self, from: Party, sends: Vec<(Party, Message)>) {
        let silent =
            |party: &Party| matches!(party, Party::Owner(rover) if self.silent.contains(rover));
        let heard = sends
            .into_iter()
            .filter(|(to, _)| !silent(to) && !silent(&from));
        self.queue
            .extend(heard.map(|(to, message)| (from, to, message)));
    }

    fn deliver(&mut self) {
        while let Some((from, to, message)) = self.queue.pop_front() {
            let sends = match to {
                Party::Owner(rover) => {
                    self.owners[rover as usize]
                        .receive(self.now, &message)
                        .sends
                }
                Party::Centre(_) => self.centre.receive(self.now, &message).sends,
            };
            self.arrived.push((from, to, message));
            self.send(to, sends);
        }
    }

    /// Something that the centre's planner or the science team does.
    pub(crate) fn centre<W, E: std::fmt::Debug>(
        &mut self,
        call: impl FnOnce(&mut Centre, SimTime) -> Result<Output<W>, E>,
    ) {
        let out = call(&mut self.centre, self.now).unwrap();
        let site = self.centre.settings().candidates[0];
        self.send(Party::Centre(site), out.sends);
        self.deliver();
    }

    /// Something that a rover's planner does.
    pub(crate) fn owner(
        &mut self,
        rover: u32,
        call: impl FnOnce(&mut Owner, SimTime) -> Result<Output<OwnerWrite>, OwnerError>,
    ) -> Result<(), OwnerError> {
        let out = call(&mut self.owners[rover as usize], self.now)?;
        self.send(Party::Owner(rover), out.sends);
        self.deliver();
        Ok(())
    }

    /// A rover crashes, and is up again with what it has written.
    pub(crate) fn restart(&mut self, rover: u32) {
        let settings = Arc::new(self.centre.settings().clone());
        let durable = self.owners[rover as usize].durable().clone();
        let (owner, out) = Owner::start(settings, rover, durable, self.now);
        self.owners[rover as usize] = owner;
        self.send(Party::Owner(rover), out.sends);
        self.deliver();
    }

    /// Lets time pass, in which everyone does what is due.
    pub(crate) fn pass(&mut self, time: SimDuration) {
        let until = self.now + time;
        loop {
            let owners = self.owners.iter().map(|owner| owner.wake(self.now));
            let next = owners.chain([self.centre.wake(self.now)]).min().unwrap();
            if next > until {
                break;
            }
            self.now = next;
            let sends = self.centre.tick(self.now).sends;
            self.send(Party::Centre(self.centre.settings().candidates[0]), sends);
            for rover in 0..self.owners.len() {
                let sends = self.owners[rover].tick(self.now).sends;
                self.send(Party::Owner(rover as u32), sends);
            }
            self.deliver();
        }
        self.now = until;
    }
}
