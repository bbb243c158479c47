//! A run to be: who takes part, what goes wrong, and when.

use std::sync::Arc;

use farside::random::{RandomKey, Stream};
use farside::{SimDuration, SimTime};
use farside_misus::shac::{Calendar, Definitions, Party, Rules, Settings};

/// The protocols of which each run has one; the last is not built in.
pub(crate) const PROTOCOLS: [&str; 4] = ["assign-and-release", "lease", "market", "in-turn"];

/// A protocol that is not built in.
pub(crate) const IN_TURN: &str = r#"
[protocol.in-turn]
chooser = "least-loaded"
lease = "50min"
reassign = "lease"
revocable = true
give_up_after = 3
"#;

/// After which messages are lost no more, and everyone stays up.
pub(crate) const HEALS: SimTime = SimTime::from_secs(3 * 3600);
/// From when on nobody takes a goal any more.
pub(crate) const CALMS: SimTime = SimTime::from_secs(4 * 3600);
/// When every goal has to be settled: a lease, two guards, two silences and an hour later.
pub(crate) const ENDS: SimTime = SimTime::from_secs(7 * 3600 + 1800);

/// A run to be. All draws within it come from its seed by name, so that leaving out a crash leaves the
/// rest as it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scenario {
    pub(crate) seed: u64,
    /// A number in [`PROTOCOLS`].
    pub(crate) protocol: usize,
    pub(crate) rovers: u32,
    pub(crate) candidates: Vec<u32>,
    pub(crate) has_elections: bool,
    pub(crate) has_windows: bool,
    /// Single goals are numbered from 0.
    pub(crate) goals: u32,
    /// Halves of joint goals are numbered from 100.
    pub(crate) pairs: u32,
    pub(crate) loss: f64,
    pub(crate) duplication: f64,
    /// Messages take up to so long, each its own time, so that they overtake each other.
    pub(crate) delay_s: u64,
    /// How much two clocks may differ; the guard is a minute.
    pub(crate) skew_s: u64,
    /// The chance that an event is a party's last before a crash.
    pub(crate) crash_at_event: f64,
    /// The chance that a rover starts what it holds, each time its planner looks.
    pub(crate) zeal: f64,
    pub(crate) partitions: Vec<Partition>,
    pub(crate) crashes: Vec<Crash>,
    pub(crate) wishes: Vec<Wishing>,
}

/// Parties whose bit is set reach only each other, and the others only each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Partition {
    pub(crate) from_s: u64,
    pub(crate) for_s: u64,
    pub(crate) side: u32,
}

/// A party that crashes and comes back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crash {
    /// Its number among the settings' parties.
    pub(crate) party: u32,
    pub(crate) at_s: u64,
    pub(crate) for_s: u64,
}

/// Something that the science team wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wishing {
    pub(crate) at_s: u64,
    pub(crate) goal: u32,
    pub(crate) what: Wished,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wished {
    /// Withdrawn.
    Not,
    /// Wished for again, if it was withdrawn.
    Again,
    /// With another weight.
    Reweighed,
}

impl Scenario {
    /// A random one.
    pub(crate) fn random(seed: u64) -> Scenario {
        let mut draw = RandomKey::new(seed).text("scenario").stream();
        let rovers = 1 + draw.below(4) as u32;
        let lander = rovers;
        let candidates = match draw.below(3) {
            0 => vec![lander],
            1 => vec![lander, 0],
            _ => vec![0, rovers - 1, lander],
        };
        let mut candidates = candidates;
        candidates.dedup();
        let parties = u64::from(rovers) + candidates.len() as u64;
        let until = HEALS.as_nanos() / 1_000_000_000;
        let mut times = |most: u64, lengths: u64| -> Vec<(u64, u64, u64)> {
            let count = draw.below(most + 1);
            let time = |draw: &mut Stream| {
                let (at, length) = (draw.below(until), 1 + draw.below(lengths));
                (at, length, draw.next_u64())
            };
            (0..count).map(|_| time(&mut draw)).collect()
        };
        let partitions = times(3, 5400)
            .into_iter()
            .map(|(from_s, for_s, bits)| Partition {
                from_s,
                for_s,
                side: (bits % (1 << parties)) as u32,
            });
        let partitions = partitions.collect();
        let crashes = times(4, 3600).into_iter().map(|(at_s, for_s, bits)| Crash {
            party: (bits % parties) as u32,
            at_s,
            for_s,
        });
        let crashes = crashes.collect();
        let goals = 1 + draw.below(5) as u32;
        let pairs = draw.below(3) as u32 * u32::from(rovers > 1);
        let wishes = (0..draw.below(5)).map(|_| Wishing {
            at_s: draw.below(until),
            goal: draw.below(u64::from(goals)) as u32,
            what: [Wished::Not, Wished::Again, Wished::Reweighed][draw.below(3) as usize],
        });
        let wishes = wishes.collect();
        Scenario {
            seed,
            protocol: draw.below(PROTOCOLS.len() as u64) as usize,
            rovers,
            candidates,
            has_elections: draw.chance(0.6),
            has_windows: draw.chance(0.3),
            goals,
            pairs,
            loss: draw.uniform_in(0.0, 0.9),
            duplication: draw.uniform_in(0.0, 0.5),
            delay_s: 1 + draw.below(300),
            skew_s: 60,
            crash_at_event: if draw.chance(0.5) { 0.004 } else { 0.0 },
            zeal: draw.uniform_in(0.02, 0.4),
            partitions,
            crashes,
            wishes,
        }
    }

    /// What its parties know.
    pub(crate) fn settings(&self, rules: Rules) -> Arc<Settings> {
        let mut definitions = Definitions::builtin();
        definitions.read("in-turn", IN_TURN).unwrap();
        let name = PROTOCOLS[self.protocol % PROTOCOLS.len()];
        let mut protocol = definitions.protocol(name).unwrap().clone();
        // As in the built-in ones, in the proportions of a short run.
        let minutes = |count: u64| SimDuration::from_secs(60 * count);
        protocol.lease = protocol.lease.map(|_| minutes(50));
        let windows = if self.has_windows {
            Calendar::repeated(SimTime::from_secs(100), minutes(10), minutes(20)).unwrap()
        } else {
            Calendar::always()
        };
        let settings = Settings {
            rovers: self.rovers,
            candidates: self.candidates.clone(),
            activity: definitions.activity("observation").unwrap().clone(),
            protocol,
            guard: SimDuration::from_secs(60),
            election: self.has_elections.then(|| minutes(25)),
            stagger: minutes(2),
            windows,
            resend_first: SimDuration::from_secs(10),
            resend_most: minutes(5),
            status_every: minutes(8),
            sol: minutes(120),
            rules,
        };
        settings.check().unwrap();
        Arc::new(settings)
    }

    /// Whether two parties reach each other at an instant.
    pub(crate) fn is_connected(&self, at: SimTime, a: usize, b: usize) -> bool {
        let seconds = at.as_nanos() / 1_000_000_000;
        at >= HEALS
            || self.partitions.iter().all(|partition| {
                let is_on =
                    (partition.from_s..partition.from_s + partition.for_s).contains(&seconds);
                let side = |party: usize| partition.side >> party & 1;
                !is_on || side(a) == side(b)
            })
    }
}

/// Whether two parties are at one place, so that no link is between them.
pub(crate) fn is_one_place(a: Party, b: Party) -> bool {
    let site = |party| match party {
        Party::Owner(site) | Party::Centre(site) => site,
    };
    site(a) == site(b)
}
