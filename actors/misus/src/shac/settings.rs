//! What all participants know from the start: who takes part, by which protocol, and how patient they
//! are.

use farside::{SimDuration, SimTime};
use thiserror::Error;

use super::calendar::Calendar;
use super::definition::{DefinitionError, Definitions, Protocol, Reassign, SharedActivity};
use super::values::Party;

/// What all participants know.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How many rovers there are. Each has an owner.
    pub rovers: u32,
    /// The sites at which a centre may run, the first choice first. A site below [`Settings::rovers`]
    /// is that rover, another one a lander.
    pub candidates: Vec<u32>,
    /// The activity that is shared, and who may set what of it.
    pub activity: SharedActivity,
    /// How goals change hands.
    pub protocol: Protocol,
    /// How much later than a lease's end somebody else may get the goal: at least the most that two
    /// clocks differ.
    pub guard: SimDuration,
    /// After which silence of the centre another one is elected; none if never. It is as well how long
    /// a majority's promise lasts.
    pub election: Option<SimDuration>,
    /// How long a candidate lets those before it go first, for each of them.
    pub stagger: SimDuration,
    /// When messages may be sent.
    pub windows: Calendar,
    /// How long after the first sending something that is not acknowledged is sent again. It doubles
    /// each time.
    pub resend_first: SimDuration,
    /// The longest time between two sendings.
    pub resend_most: SimDuration,
    /// How often an owner tells candidates its status when nothing has changed.
    pub status_every: SimDuration,
    /// After each of these all refusals have expired.
    pub sol: SimDuration,
    /// Which rules are kept.
    pub rules: Rules,
}

/// Which rules are kept. All of them, but in tests that show what each is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rules {
    /// What is decided is written before it is sent (rule 1).
    pub write_first: bool,
    /// An owner accepts a grant only if it is newer than the last it had (rule 2).
    pub newer_only: bool,
    /// Of each rover the status with the highest version holds (rule 3).
    pub highest_status: bool,
    /// What has started is not released (rule 4).
    pub release_binds: bool,
    /// Only what is said of the present grant counts (rule 5).
    pub present_epoch_only: bool,
    /// Who has refused a goal is not asked again before something changes (rule 5).
    pub refusals_hold: bool,
    /// A goal that is taken back is somebody else's only when its owner has agreed (rule 6).
    pub revoke_safely: bool,
    /// An activity starts only if it ends within its lease (rule 7).
    pub start_in_lease: bool,
    /// Everyone passes on all outcomes that it knows of (rule 8).
    pub pass_outcomes_on: bool,
    /// Who learns that a goal is achieved drops it, unless it has started (rule 9).
    pub drop_achieved: bool,
    /// A new centre waits out leases that it may not know (rule 10).
    pub wait_out: bool,
    /// Of two editions of a goal the later holds, whichever centre's grant is later (rule 10).
    pub withdrawn_for_good: bool,
    /// A centre grants nothing without the promises of a majority.
    pub mandate: bool,
    /// Half of a joint goal starts only when another rover is bound to the other half.
    pub bind_pairs: bool,
}

impl Rules {
    /// All of them.
    pub const ALL: Rules = Rules {
        write_first: true,
        newer_only: true,
        highest_status: true,
        release_binds: true,
        present_epoch_only: true,
        revoke_safely: true,
        start_in_lease: true,
        pass_outcomes_on: true,
        drop_achieved: true,
        wait_out: true,
        mandate: true,
        bind_pairs: true,
        refusals_hold: true,
        withdrawn_for_good: true,
    };
}

/// Settings that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SettingsError {
    /// No such protocol or activity.
    #[error(transparent)]
    Definition(#[from] DefinitionError),
    /// Nobody to do anything.
    #[error("rovers = 0: expected at least 1")]
    NoRovers,
    /// No site for a centre, or one twice.
    #[error("candidates = {actual:?}: expected at least one site, each once")]
    Candidates {
        /// What was given.
        actual: Vec<u32>,
    },
    /// A time that has to pass is zero, or one that has to be longer than another is not.
    #[error("{key} = {actual}: expected over {expected}")]
    TooShort {
        /// Which.
        key: &'static str,
        /// What was given.
        actual: SimDuration,
        /// What it has to be over.
        expected: SimDuration,
    },
}

impl Settings {
    /// The settings for a built-in protocol, so many rovers and these sites for a centre: one day to a
    /// sol, resent after 10 s to 10 min, at any time, a guard of 10 s, no elections.
    ///
    /// # Errors
    /// As [`Settings::check`], or when there is no such protocol.
    pub fn new(protocol: &str, rovers: u32, candidates: &[u32]) -> Result<Settings, SettingsError> {
        let definitions = Definitions::builtin();
        let settings = Settings {
            rovers,
            candidates: candidates.to_vec(),
            activity: definitions.activity("observation")?.clone(),
            protocol: definitions.protocol(protocol)?.clone(),
            guard: SimDuration::from_secs(10),
            election: None,
            stagger: SimDuration::from_secs(60),
            windows: Calendar::always(),
            resend_first: SimDuration::from_secs(10),
            resend_most: SimDuration::from_secs(600),
            status_every: SimDuration::from_secs(600),
            sol: SimDuration::from_millis(88_775_244),
            rules: Rules::ALL,
        };
        settings.check()?;
        Ok(settings)
    }

    /// Whether they can be.
    ///
    /// # Errors
    /// When there is no rover, no candidate, or a time is too short for its purpose.
    pub fn check(&self) -> Result<(), SettingsError> {
        if self.rovers == 0 {
            return Err(SettingsError::NoRovers);
        }
        let mut sites = self.candidates.clone();
        sites.sort_unstable();
        sites.dedup();
        if sites.is_empty() || sites.len() != self.candidates.len() {
            let actual = self.candidates.clone();
            return Err(SettingsError::Candidates { actual });
        }
        let zero = SimDuration::ZERO;
        let mut at_least = vec![
            ("stagger", self.stagger, zero),
            ("resend_first", self.resend_first, zero),
            ("status_every", self.status_every, zero),
            ("sol", self.sol, zero),
        ];
        if let Some(silence) = self.election {
            at_least.push(("election", silence, self.guard * 2));
        }
        if let Some(lease) = self.protocol.lease {
            at_least.push(("lease", lease, self.guard));
        }
        for (key, actual, expected) in at_least {
            if actual <= expected {
                return Err(SettingsError::TooShort {
                    key,
                    actual,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// All participants: the owners by rover, then the candidates.
    pub fn parties(&self) -> Vec<Party> {
        let owners = (0..self.rovers).map(Party::Owner);
        let centres = self.candidates.iter().map(|&site| Party::Centre(site));
        owners.chain(centres).collect()
    }

    /// The place of a participant among [`Settings::parties`].
    pub(super) fn index(&self, party: Party) -> Option<usize> {
        match party {
            Party::Owner(rover) => (rover < self.rovers).then_some(rover as usize),
            Party::Centre(site) => {
                let place = self.candidates.iter().position(|&other| other == site);
                place.map(|place| self.rovers as usize + place)
            }
        }
    }

    /// How many candidates are asked before this one.
    pub(crate) fn rank(&self, site: u32) -> u64 {
        let place = self.candidates.iter().position(|&other| other == site);
        place.unwrap_or(self.candidates.len()) as u64
    }

    /// When a lease that is granted now ends.
    pub(crate) fn lease_end(&self, now: SimTime) -> SimTime {
        let lease = self.protocol.lease;
        lease.map_or(SimTime::MAX, |lease| now.saturating_add(lease))
    }

    /// Whether goals of owners that do not answer are handed out again.
    pub(super) fn reassigns(&self) -> bool {
        self.protocol.reassign == Reassign::Lease
    }

    /// Which sol it is.
    pub(super) fn sol_of(&self, now: SimTime) -> u64 {
        now.as_nanos() / self.sol.as_nanos()
    }
}
