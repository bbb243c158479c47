//! The network, the clocks, the crashes, and the order of events.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::Arc;

use farside::random::RandomKey;
use farside::{SimDuration, SimTime};
use farside_misus::shac::{
    Centre, CentreDurable, CentreWrite, GoalKey, Message, Outcome, Output, Owner, OwnerDurable,
    OwnerWrite, Party, Rules, Settings, SharedGoal,
};

use super::checks::{Checks, Violation};
use super::scenario::{ENDS, HEALS, Scenario, Wished, is_one_place};

/// No run has so many events, unless parties answer each other without end.
const MOST_EVENTS: u64 = 300_000;

/// What a run came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) events: u64,
    pub(crate) sent: u64,
    pub(crate) crashes: u64,
    pub(crate) starts: u64,
    pub(crate) achieved: u64,
    pub(crate) duplicates: u64,
    pub(crate) elections: u64,
    pub(crate) unachievable: u64,
    pub(crate) pooled: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Tally) {
        self.events += other.events;
        self.sent += other.sent;
        self.crashes += other.crashes;
        self.starts += other.starts;
        self.achieved += other.achieved;
        self.duplicates += other.duplicates;
        self.elections += other.elections;
        self.unachievable += other.unachievable;
        self.pooled += other.pooled;
    }
}

/// An owner or a centre, while it is up, and what it has written.
pub(crate) enum Seat {
    Owner(Option<Owner>, OwnerDurable),
    Centre(Option<Centre>, CentreDurable),
}

enum Event {
    Deliver {
        to: usize,
        message: Message,
    },
    /// A timer of a party. Only the latest counts.
    Wake(usize, u64),
    /// A planner looks at what it may decide.
    Plan(usize),
    Crash(usize, SimDuration),
    Restart(usize),
    Wish(usize),
}

/// A run that goes on.
pub(crate) struct World {
    pub(crate) scenario: Scenario,
    pub(crate) settings: Arc<Settings>,
    pub(crate) parties: Vec<Party>,
    pub(crate) seats: Vec<Seat>,
    /// What each rover's hardware is doing or has done, and when that ends.
    pub(crate) hardware: Vec<BTreeMap<GoalKey, SimTime>>,
    /// All that was done, as it was.
    pub(crate) done: Vec<Outcome>,
    pub(crate) now: SimTime,
    pub(crate) tally: Tally,
    pub(crate) checks: Checks,
    queue: BinaryHeap<Reverse<(SimTime, u64)>>,
    events: BTreeMap<u64, Event>,
    wakes: Vec<u64>,
    counter: u64,
    /// Printed as they happen, to read a scenario that went wrong.
    is_told: bool,
}

impl World {
    pub(crate) fn new(scenario: Scenario, rules: Rules) -> World {
        let settings = scenario.settings(rules);
        let parties = settings.parties();
        let seats = parties.iter().map(|party| match party {
            Party::Owner(_) => Seat::Owner(None, OwnerDurable::default()),
            Party::Centre(_) => Seat::Centre(None, CentreDurable::default()),
        });
        let mut world = World {
            seats: seats.collect(),
            hardware: vec![BTreeMap::new(); scenario.rovers as usize],
            done: Vec::new(),
            now: SimTime::ZERO,
            tally: Tally::default(),
            checks: Checks::new(&parties),
            queue: BinaryHeap::new(),
            events: BTreeMap::new(),
            wakes: vec![0; parties.len()],
            counter: 0,
            is_told: std::env::var("SHAC_TELL").is_ok(),
            parties,
            settings,
            scenario,
        };
        world.begin();
        world
    }

    fn begin(&mut self) {
        for party in 0..self.parties.len() {
            self.put(SimTime::ZERO, Event::Restart(party));
            self.put(SimTime::from_secs(7 * party as u64), Event::Plan(party));
        }
        for crash in self.scenario.crashes.clone() {
            let party = crash.party as usize % self.parties.len();
            let length = SimDuration::from_secs(crash.for_s);
            self.put(SimTime::from_secs(crash.at_s), Event::Crash(party, length));
        }
        for (index, wish) in self.scenario.wishes.clone().iter().enumerate() {
            self.put(SimTime::from_secs(wish.at_s), Event::Wish(index));
        }
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// What was violated first, and when.
    pub(crate) fn run(mut self) -> Result<Tally, Violation> {
        while let Some(Reverse((at, number))) = self.queue.pop() {
            if at > ENDS {
                break;
            }
            self.now = at;
            self.tally.events += 1;
            if self.tally.events > MOST_EVENTS {
                self.violated("messages without end", String::new())?;
            }
            let event = self
                .events
                .remove(&number)
                .expect("each event is queued once");
            self.handle(event)?;
            self.check()?;
        }
        self.now = ENDS;
        self.check_end()?;
        Ok(self.tally)
    }

    fn put(&mut self, at: SimTime, event: Event) {
        self.counter += 1;
        self.events.insert(self.counter, event);
        self.queue.push(Reverse((at, self.counter)));
    }

    /// A draw for one purpose; the same whatever else is drawn.
    pub(crate) fn draw(&self, purpose: &str, number: u64) -> f64 {
        let key = RandomKey::new(self.scenario.seed)
            .text(purpose)
            .number(number);
        key.number(self.now.as_nanos()).uniform()
    }

    /// The clock of a party, each as much too fast as is its own.
    pub(crate) fn clock(&self, party: usize) -> SimTime {
        self.now + self.skew(party)
    }

    fn skew(&self, party: usize) -> SimDuration {
        let key = RandomKey::new(self.scenario.seed).text("skew");
        let skew_s = self.scenario.skew_s as f64;
        SimDuration::from_secs_f64(key.number(party as u64).uniform() * skew_s)
    }

    fn handle(&mut self, event: Event) -> Result<(), Violation> {
        match event {
            Event::Deliver { to, message } => self.deliver(to, &message),
            Event::Wake(party, number) => {
                if self.wakes[party] == number {
                    self.tick(party);
                }
            }
            Event::Plan(party) => {
                self.plan(party)?;
                let wait = 30.0 + 120.0 * self.draw("plan", party as u64);
                self.put(
                    self.now + SimDuration::from_secs_f64(wait),
                    Event::Plan(party),
                );
            }
            Event::Crash(party, length) => self.crash(party, length),
            Event::Restart(party) => self.restart(party),
            Event::Wish(index) => self.wish(index),
        }
        Ok(())
    }

    fn deliver(&mut self, to: usize, message: &Message) {
        let clock = self.clock(to);
        self.tell(|| format!("-> {:?}: {message:?}", self.parties[to]));
        match &mut self.seats[to] {
            Seat::Owner(Some(owner), _) => {
                let out = owner.receive(clock, message);
                self.owner_out(to, out);
            }
            Seat::Centre(Some(centre), _) => {
                let out = centre.receive(clock, message);
                self.centre_out(to, out);
            }
            Seat::Owner(None, _) | Seat::Centre(None, _) => {}
        }
    }

    fn tick(&mut self, party: usize) {
        let clock = self.clock(party);
        match &mut self.seats[party] {
            Seat::Owner(Some(owner), _) => {
                let out = owner.tick(clock);
                self.owner_out(party, out);
            }
            Seat::Centre(Some(centre), _) => {
                let out = centre.tick(clock);
                self.centre_out(party, out);
            }
            Seat::Owner(None, _) | Seat::Centre(None, _) => {}
        }
    }

    fn crash(&mut self, party: usize, length: SimDuration) {
        let is_up = match &mut self.seats[party] {
            Seat::Owner(owner, _) => owner.take().is_some(),
            Seat::Centre(centre, _) => centre.take().is_some(),
        };
        if is_up {
            self.tell(|| format!("{:?} crashes", self.parties[party]));
            self.tally.crashes += 1;
            let back = (self.now + length).min(HEALS);
            self.put(back.max(self.now), Event::Restart(party));
        }
    }

    fn restart(&mut self, party: usize) {
        let (clock, settings) = (self.clock(party), self.settings.clone());
        match (&mut self.seats[party], self.parties[party]) {
            (Seat::Owner(owner @ None, durable), Party::Owner(rover)) => {
                let (started, out) = Owner::start(settings, rover, durable.clone(), clock);
                *owner = Some(started);
                self.owner_out(party, out);
            }
            (Seat::Centre(centre @ None, durable), Party::Centre(site)) => {
                let (started, out) = Centre::start(settings, site, durable.clone(), clock);
                *centre = Some(started);
                self.centre_out(party, out);
                self.wish_first(party);
            }
            _ => {}
        }
    }

    /// All goals are wished for at the first candidate, when it starts for the first time.
    fn wish_first(&mut self, party: usize) {
        if party != self.scenario.rovers as usize {
            return;
        }
        let goals = (0..self.scenario.goals).map(|number| (number, None));
        let pairs = (0..self.scenario.pairs).flat_map(|pair| {
            let halves = (100 + 2 * pair, 101 + 2 * pair);
            [(halves.0, Some(halves.1)), (halves.1, Some(halves.0))]
        });
        let all: Vec<(u32, Option<u32>)> = goals.chain(pairs).collect();
        let clock = self.clock(party);
        for (number, partner) in all {
            let goal = goal_of(number, partner);
            if let Seat::Centre(Some(centre), _) = &mut self.seats[party]
                && centre.standing(goal.key).is_none()
            {
                let out = centre.add(clock, goal).expect("a goal that can be");
                self.checks.added(goal.key);
                self.centre_out(party, out);
            }
        }
    }

    fn wish(&mut self, index: usize) {
        let wish = self.scenario.wishes[index];
        let goal = goal_of(wish.goal % self.scenario.goals, None);
        // Any of the candidates may be where the science team is heard.
        let candidates = self.scenario.candidates.len();
        let place = (self.draw("wish", index as u64) * candidates as f64) as usize;
        let party = self.scenario.rovers as usize + place;
        let clock = self.clock(party);
        let Seat::Centre(Some(centre), _) = &mut self.seats[party] else {
            return;
        };
        let known = centre.durable().table.get(&goal.key);
        let Some(known) = known.map(|record| record.wish) else {
            return;
        };
        let done = match wish.what {
            Wished::Not => centre.withdraw(clock, goal.key),
            Wished::Again => centre.add(clock, goal),
            Wished::Reweighed => {
                let mut parameters = known.goal.parameters;
                parameters.weight += 1.0;
                centre.change(clock, goal.key, &parameters)
            }
        };
        if let Ok(out) = done {
            self.tell(|| format!("{:?} wishes {wish:?}", self.parties[party]));
            if wish.what == Wished::Again {
                self.checks.added(goal.key);
            }
            self.centre_out(party, out);
        }
    }

    /// Writes, sends, and sets the timer of an owner. A crash may come before, between and after.
    pub(crate) fn owner_out(&mut self, party: usize, out: Output<OwnerWrite>) {
        self.tally_writes(party, &out.writes);
        if let Seat::Owner(_, durable) = &mut self.seats[party] {
            out.writes.iter().for_each(|write| durable.apply(write));
        }
        self.post(party, out.sends);
    }

    /// As [`World::owner_out`], for a centre.
    pub(crate) fn centre_out(&mut self, party: usize, out: Output<CentreWrite>) {
        self.tally_writes(party, &out.writes);
        for write in &out.writes {
            if let CentreWrite::Office(office) = write
                && office.elected == office.term
            {
                self.tally.elections += 1;
            }
        }
        if let Seat::Centre(_, durable) = &mut self.seats[party] {
            out.writes.iter().for_each(|write| durable.apply(write));
        }
        self.post(party, out.sends);
    }

    fn tally_writes<W: std::fmt::Debug>(&self, party: usize, writes: &[W]) {
        for write in writes {
            self.tell(|| format!("{:?} writes {write:?}", self.parties[party]));
        }
    }

    fn post(&mut self, party: usize, sends: Vec<(Party, Message)>) {
        let crashes =
            self.now < HEALS && self.draw("crash", self.counter) < self.scenario.crash_at_event;
        let mut kept = sends.len();
        if crashes {
            kept = (self.draw("cut", self.counter) * (kept + 1) as f64) as usize;
        }
        for (to, message) in sends.into_iter().take(kept) {
            self.send(party, to, message);
        }
        if crashes {
            let length = 1.0 + 2400.0 * self.draw("down", self.counter);
            self.crash(party, SimDuration::from_secs_f64(length));
        } else {
            self.set_timer(party);
        }
    }

    fn set_timer(&mut self, party: usize) {
        let clock = self.clock(party);
        let wake = match &self.seats[party] {
            Seat::Owner(Some(owner), _) => owner.wake(clock),
            Seat::Centre(Some(centre), _) => centre.wake(clock),
            Seat::Owner(None, _) | Seat::Centre(None, _) => return,
        };
        let ahead = wake.since(clock);
        self.counter += 1;
        self.wakes[party] = self.counter;
        if wake < SimTime::MAX {
            let at = self.now + ahead;
            self.events
                .insert(self.counter, Event::Wake(party, self.counter));
            self.queue.push(Reverse((at, self.counter)));
        }
    }

    fn send(&mut self, from: usize, to: Party, message: Message) {
        let place = self.parties.iter().position(|party| *party == to);
        let to = place.expect("machines send to parties only");
        self.tally.sent += 1;
        let number = self.counter;
        let is_one_place = is_one_place(self.parties[from], self.parties[to]);
        let is_lost = self.draw("loss", number) < self.scenario.loss && self.now < HEALS;
        let is_cut = !self.scenario.is_connected(self.now, from, to);
        if (is_lost || is_cut) && !is_one_place {
            self.counter += 1;
            return;
        }
        let is_doubled = self.draw("double", number) < self.scenario.duplication;
        for copy in 0..1 + u64::from(is_doubled) {
            let longest = if self.now < HEALS {
                self.scenario.delay_s as f64
            } else {
                2.0
            };
            let delay = if is_one_place {
                0.001
            } else {
                0.1 + longest * self.draw("delay", number * 2 + copy)
            };
            let at = self.now + SimDuration::from_secs_f64(delay);
            let message = message.clone();
            self.put(at, Event::Deliver { to, message });
        }
    }

    pub(crate) fn tell(&self, line: impl FnOnce() -> String) {
        if self.is_told {
            println!("{} {}", self.now, line());
        }
    }
}

fn goal_of(number: u32, partner: Option<u32>) -> SharedGoal {
    let duration = SimDuration::from_secs(300 + 60 * u64::from(number % 7));
    let place = [f64::from(number), f64::from(number % 3)];
    let mut goal = SharedGoal::new(GoalKey::Numbered(number), place, duration);
    goal.partner = partner.map(GoalKey::Numbered);
    goal
}
