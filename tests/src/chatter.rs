//! A model without a purpose: hosts of actors that send, set and cancel timers, draw, crash and
//! fail as a random description says. It is there to meet every rule of the kernel at once.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{Carriage, Carrier, Parcel, Verdicts};
use serde::{Deserialize, Serialize};

/// What a run of the model looks like. Small numbers, so that a failing case can be read.
#[derive(Clone, Debug)]
pub struct Chatter {
    /// The run's seed.
    pub seed: u64,
    /// Shuffles ties, if given.
    pub tie_seed: Option<u64>,
    /// How many actors live on each host; a host is heavy if its number is odd.
    pub hosts: Vec<u8>,
    /// Least delay of every link (ns); 0 means no look-ahead at all.
    pub min_delay_ns: u64,
    /// Jitter on top, uniform (ns).
    pub jitter_ns: u64,
    /// Loss and duplication probability of the links, in 1/16.
    pub loss_16: u8,
    /// Further copies, in 1/16.
    pub copies_16: u8,
    /// How often links hold a copy, in 1/16; what they hold they may hold again.
    pub holds_16: u8,
    /// Even hosts send through one shared link.
    pub shared: bool,
    /// Crash and restart events: actor, time (ns), and whether it is a restart.
    pub controls: Vec<(u8, u64, bool)>,
    /// Links charge receivers, and what a host was charged is part of what its actors say.
    pub hosts_energy: bool,
    /// Who is told something, when (ns), and how many hops it makes from there.
    pub tells: Vec<(u8, u64, u8)>,
    /// After how many messages handled by one actor it asks to stop; 0 for never.
    pub stop_after: u32,
    /// After how many messages handled by one actor it fails, by error or, if odd, by panic.
    pub fail_after: u32,
    /// End of the run (ns).
    pub until_ns: u64,
}

/// A message that makes its receiver do something.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chat {
    hops: u32,
    note: Option<String>,
}

/// A timer's message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    number: u64,
}

/// A state sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mood {
    handled: u32,
}

/// A change of every link: a new loss probability in 1/16.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct NewLoss {
    loss_16: u8,
}

struct Talker {
    names: Arc<Vec<(String, usize)>>,
    host: usize,
    hosts_energy: bool,
    handled: u32,
    stop_after: u32,
    fail_after: u32,
    last_timer: Option<TimerId>,
}

#[derive(Default)]
struct Memory(u64);

impl Actor for Talker {
    type Accepts = (Chat, Tick);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let first = SimDuration::from_nanos(ctx.random("start").below(5));
        ctx.timer(first, Tick { number: 0 });
        self.talk(ctx, 3)
    }
}

impl Talker {
    fn energies(&self, name: &str, ctx: &Context<'_, Self>) -> String {
        let own_j = ctx.transmit_energy_j();
        match self.hosts_energy {
            false => format!("{name} {own_j}"),
            true => {
                let (sent_j, received_j) =
                    (ctx.host_transmit_energy_j(), ctx.host_receive_energy_j());
                format!("{name} {own_j} {sent_j} {received_j}")
            }
        }
    }

    fn talk(&mut self, ctx: &mut Context<'_, Self>, hops: u32) -> Outcome {
        if hops == 0 {
            return Ok(());
        }
        let names = self.names.clone();
        for _ in 0..ctx.random("how_many").below(3) {
            let (name, host) = &names[ctx.random("to").below(names.len() as u64) as usize];
            let to = ctx.lookup::<Talker>(name)?;
            let chat = Chat {
                hops: hops - 1,
                // What links charge is part of what happens.
                note: hops.is_multiple_of(2).then(|| self.energies(name, ctx)),
            };
            match ctx.random("how").below(3) {
                0 => ctx.send_keyed(to, MatchKey::new(hops, self.handled), chat),
                1 if *host == self.host => {
                    let delay = SimDuration::from_nanos(ctx.random("delay").below(4));
                    ctx.send_after(to, delay, chat);
                }
                _ => ctx.send(to.recipient::<Chat>(), chat),
            }
        }
        Ok(())
    }

    fn count(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.handled += 1;
        ctx.durable::<Memory>().0 += 1;
        ctx.sample(&Mood {
            handled: self.handled,
        });
        if self.handled == self.stop_after {
            ctx.stop("enough");
        }
        if self.handled == self.fail_after {
            assert!(self.fail_after.is_multiple_of(2), "an odd count");
            return Err(HandlerError::new("an even count"));
        }
        Ok(())
    }
}

impl Handler<Chat> for Talker {
    fn handle(&mut self, chat: Chat, ctx: &mut Context<'_, Self>) -> Outcome {
        self.count(ctx)?;
        self.talk(ctx, chat.hops)
    }
}

impl Handler<Tick> for Talker {
    fn handle(&mut self, tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        self.count(ctx)?;
        let wait = SimDuration::from_nanos(1 + ctx.random("wait").below(9));
        let number = ctx.durable::<Memory>().0;
        let link = ctx.links().first().copied();
        if let Some(link) = link.filter(|_| number.is_multiple_of(4)) {
            let loss_16 = ctx.random("loss").below(17) as u8;
            ctx.tell_link::<NewLoss>(link, NewLoss { loss_16 });
        }
        let timer = ctx.timer(wait, Tick { number });
        let spare = ctx.timer(wait, Tick { number: number + 1 });
        ctx.cancel(spare);
        if tick.number.is_multiple_of(3)
            && let Some(last) = self.last_timer.replace(timer)
        {
            ctx.cancel(last);
        }
        self.talk(ctx, 4)
    }
}

/// A link with jitter, loss and further copies, all drawn by message identity.
struct Noisy {
    min_delay: SimDuration,
    jitter_ns: u64,
    loss_16: u8,
    copies_16: u8,
    holds_16: u8,
    undercut: bool,
    receive_j: f64,
}

impl Carrier for Noisy {
    type Change = NewLoss;

    fn min_delay(&self) -> SimDuration {
        self.min_delay
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let one_in_16 = |p: u8| f64::from(p) / 16.0;
        let held = parcel.token();
        let copies = match held {
            Some(_) => 1,
            None => 1 + u32::from(parcel.random(1, 0, 0).uniform() < one_in_16(self.copies_16)),
        };
        let round = held.map_or(0, |token| token as u32 + 1);
        for copy in parcel.copy()..parcel.copy() + copies {
            let mut draws = parcel.random(2, round, copy).stream();
            if round < 3 && draws.chance(one_in_16(self.holds_16)) {
                let wait = SimDuration::from_nanos(draws.below(6));
                verdicts.hold(wait, u64::from(round));
                continue;
            }
            verdicts.charge(0.25);
            let mut delay =
                self.min_delay + SimDuration::from_nanos(draws.below(self.jitter_ns + 1));
            if self.undercut && draws.chance(0.3) {
                delay = SimDuration::from_nanos(1);
            }
            let carriage = Carriage {
                queue: parcel.now().since(parcel.sent()),
                propagation: delay,
                attempts: round + 1,
                energy_j: 0.25,
                receive_j: self.receive_j,
                ..Carriage::default()
            };
            if draws.uniform() >= one_in_16(self.loss_16) {
                verdicts.deliver_as(delay, carriage);
            } else if draws.chance(0.5) {
                verdicts.lose_as(delay, "late", carriage);
            } else if parcel.size_bytes().is_multiple_of(2) {
                verdicts.lose("loss");
            } else {
                verdicts.lose_after(delay, "corrupt");
            }
        }
    }

    fn change(&mut self, change: NewLoss, _now: SimTime) {
        self.loss_16 = change.loss_16;
    }
}

impl Chatter {
    /// The simulation that this describes.
    pub fn build(&self) -> Simulation {
        self.build_with(false)
    }

    /// The same with links that sometimes deliver after 1 ns, whatever they declared.
    pub fn build_undercutting(&self) -> Simulation {
        self.build_with(true)
    }

    fn build_with(&self, undercut: bool) -> Simulation {
        let mut sim = Simulation::new(self.seed);
        sim.tie_seed(self.tie_seed);
        let mut names = Vec::new();
        for (host, actors) in self.hosts.iter().enumerate() {
            names.extend((0..*actors).map(|actor| (format!("h{host}/a{actor}"), host)));
        }
        let names = Arc::new(names);
        let hosts: Vec<HostId> = (0..self.hosts.len())
            .map(|host| sim.host(&format!("h{host}")))
            .collect();
        self.join(&mut sim, &hosts, undercut);
        let mut addresses = Vec::new();
        for (name, host) in names.iter() {
            let (names, host) = (names.clone(), *host);
            let (stop_after, fail_after) = (self.stop_after, self.fail_after);
            let hosts_energy = self.hosts_energy;
            addresses.push(sim.actor(hosts[host], name, move |_| Talker {
                names: names.clone(),
                host,
                hosts_energy,
                handled: 0,
                stop_after,
                fail_after,
                last_timer: None,
            }));
            if host % 2 == 1 {
                sim.heavy(hosts[host]);
            }
        }
        for (actor, time_ns, restart) in &self.controls {
            let address = addresses[*actor as usize % addresses.len()];
            let time = SimTime::from_nanos(*time_ns);
            if *restart {
                sim.restart_at(time, address);
            } else {
                sim.crash_at(time, address);
            }
        }
        for (actor, time_ns, hops) in &self.tells {
            let address = addresses[*actor as usize % addresses.len()];
            let chat = Chat {
                hops: u32::from(*hops),
                note: Some("told".to_owned()),
            };
            sim.tell_at(SimTime::from_nanos(*time_ns), address, chat);
        }
        sim.stop_at(SimTime::from_nanos(self.until_ns), "the model's end");
        sim
    }

    fn join(&self, sim: &mut Simulation, hosts: &[HostId], undercut: bool) {
        let noisy = || Noisy {
            min_delay: SimDuration::from_nanos(self.min_delay_ns),
            jitter_ns: self.jitter_ns,
            loss_16: self.loss_16,
            copies_16: self.copies_16,
            holds_16: self.holds_16,
            undercut,
            receive_j: if self.hosts_energy { 0.125 } else { 0.0 },
        };
        let medium = self.shared.then(|| sim.shared_link("medium", noisy()));
        for (a, from) in hosts.iter().enumerate() {
            for (b, to) in hosts.iter().enumerate() {
                match medium {
                    _ if a == b => {}
                    Some(medium) if a % 2 == 0 => sim.route(*from, *to, medium),
                    _ => {
                        let link = sim.link(*from, *to, &format!("h{a}-h{b}"), noisy());
                        let change = NewLoss {
                            loss_16: self.loss_16.saturating_sub(1),
                        };
                        sim.change_at(SimTime::from_nanos(self.until_ns / 2), link, change);
                    }
                }
            }
        }
    }
}

/// What [`Ledger`] found out about the messages of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// (sender, receiver, kind, ordinal, copy) of each fate, in order of commitment.
    pub fates: Vec<(usize, usize, String, u64, u32)>,
    /// Messages sent, as the records of the sending events say.
    pub sent: u64,
    /// Records whose key was not greater than that of the event before.
    pub out_of_order: u64,
    /// Records whose cause does not sort before them.
    pub before_their_cause: u64,
}

/// An observer that keeps accounts of fates.
pub struct Ledger {
    tally: Arc<Mutex<Tally>>,
    last: Option<farside::key::EventKey>,
}

impl Ledger {
    /// A ledger, and where to read it after the run.
    pub fn new() -> (Self, Arc<Mutex<Tally>>) {
        let tally = Arc::<Mutex<Tally>>::default();
        (
            Ledger {
                tally: tally.clone(),
                last: None,
            },
            tally,
        )
    }
}

impl Observer for Ledger {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let mut tally = self
            .tally
            .lock()
            .map_err(|error| ObserverError(error.to_string()))?;
        tally.sent += u64::from(record.sends);
        if self.last.is_some_and(|last| record.key < last) {
            tally.out_of_order += 1;
        }
        self.last = Some(record.key);
        let effect = record.class == RecordClass::Lost || record.class == RecordClass::Sample;
        if record
            .cause
            .is_some_and(|cause| cause > record.key || (cause == record.key && !effect))
        {
            tally.before_their_cause += 1;
        }
        if record.class.is_fate() {
            let kind = record
                .kind
                .map_or_else(String::new, |kind| kind.name().to_owned());
            let (sender, receiver) = (record.sender.index(), record.receiver.index());
            tally
                .fates
                .push((sender, receiver, kind, record.ordinal, record.copy));
        }
        Ok(Flow::Continue)
    }
}
