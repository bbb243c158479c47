//! What an actor did in a run and what it waited for, as its system tells it from the run's log.

use farside::record::RecordClass;

use super::picture::{PictureError, Recording};

/// What an actor does for a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// It does what it is there for.
    Active,
    /// It waits for somebody or something.
    Waiting,
    /// It has crashed, and was not restarted yet.
    Down,
    /// It has done all that it was to do.
    Done,
}

impl Doing {
    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Doing::Active => "active",
            Doing::Waiting => "waiting",
            Doing::Down => "down",
            Doing::Done => "done",
        }
    }
}

/// A time in which an actor does one thing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Phase {
    /// When it begins and ends, in nanoseconds since the start of the run.
    pub from_ns: u64,
    /// When it ends.
    pub until_ns: u64,
    /// What the actor does.
    pub doing: Doing,
    /// The same in words, without its name: `stands at 12, waits for rover_05 at 13`.
    pub text: String,
    /// The actors that it waits for, directly.
    pub waits_for: Vec<String>,
}

/// An actor's part in a run, from its start on.
///
/// ```
/// use farside_actors::system::{Account, Doing, Phase};
/// let phase = |from_ns, until_ns, doing| Phase {
///     from_ns, until_ns, doing, text: doing.name().to_owned(), waits_for: Vec::new(),
/// };
/// let account = Account { phases: vec![phase(0, 5, Doing::Active), phase(5, 9, Doing::Waiting)] };
/// assert_eq!((account.spent_ns(Doing::Waiting), account.done_ns()), (4, None));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// What it did, in order of time and without a gap.
    pub phases: Vec<Phase>,
}

impl Account {
    /// How long it did this, in nanoseconds.
    pub fn spent_ns(&self, doing: Doing) -> u64 {
        let phases = self.phases.iter().filter(|phase| phase.doing == doing);
        phases.map(|phase| phase.until_ns - phase.from_ns).sum()
    }

    /// When it had done all that it was to do; none if it never had.
    pub fn done_ns(&self) -> Option<u64> {
        let phases = self.phases.iter().rev();
        let done = phases.take_while(|phase| phase.doing == Doing::Done);
        done.last().map(|first| first.from_ns)
    }

    /// Adds a phase: one that says the same as the last and waits for the same goes on with it, and one
    /// without length is nothing.
    ///
    /// ```
    /// use farside_actors::system::{Account, Doing, Phase};
    /// let mut account = Account::default();
    /// for (from_ns, waits_for) in [(0, &["a", "b"][..]), (1, &["a", "b"]), (2, &["b"])] {
    ///     account.push(Phase {
    ///         from_ns,
    ///         until_ns: from_ns + 1,
    ///         doing: Doing::Waiting,
    ///         text: "waits for plans".to_owned(),
    ///         waits_for: waits_for.iter().map(|name| (*name).to_owned()).collect(),
    ///     });
    /// }
    /// let until: Vec<u64> = account.phases.iter().map(|phase| phase.until_ns).collect();
    /// assert_eq!(until, [2, 3]);
    /// ```
    pub fn push(&mut self, phase: Phase) {
        if phase.until_ns <= phase.from_ns && phase.doing != Doing::Done {
            return;
        }
        match self.phases.last_mut() {
            Some(last)
                if last.doing == phase.doing
                    && last.text == phase.text
                    && last.waits_for == phase.waits_for =>
            {
                last.until_ns = phase.until_ns;
            }
            _ => self.phases.push(phase),
        }
    }

    /// The same account, in which the actor is down from when to when it is; without an end it is to
    /// `until_ns`.
    ///
    /// ```
    /// use farside_actors::system::{Account, Doing, Phase};
    /// let mut account = Account::default();
    /// account.push(Phase {
    ///     from_ns: 0, until_ns: 9, doing: Doing::Active, text: "drives".to_owned(), waits_for: Vec::new(),
    /// });
    /// let account = account.with_outages([(3, Some(5)), (8, None)], 9);
    /// assert_eq!(account.spent_ns(Doing::Down), 3);
    /// assert_eq!(account.phases.len(), 4);
    /// ```
    #[must_use]
    pub fn with_outages(
        self,
        outages: impl IntoIterator<Item = (u64, Option<u64>)>,
        until_ns: u64,
    ) -> Account {
        let mut phases = self.phases;
        for (from_ns, to_ns) in outages {
            let to_ns = to_ns.unwrap_or(until_ns);
            let mut split = Vec::new();
            for phase in phases {
                if phase.until_ns <= from_ns || phase.from_ns >= to_ns {
                    split.push(phase);
                    continue;
                }
                if phase.from_ns < from_ns {
                    split.push(Phase {
                        until_ns: from_ns,
                        ..phase.clone()
                    });
                }
                split.push(Phase {
                    from_ns: phase.from_ns.max(from_ns),
                    until_ns: phase.until_ns.min(to_ns),
                    doing: Doing::Down,
                    text: "is down".to_owned(),
                    waits_for: Vec::new(),
                });
                if phase.until_ns > to_ns {
                    split.push(Phase {
                        from_ns: to_ns,
                        ..phase
                    });
                }
            }
            phases = split;
        }
        let mut account = Account::default();
        phases.into_iter().for_each(|phase| account.push(phase));
        account
    }
}

/// When an actor was down in a recorded run: from when to when, in order of time; without an end it was to
/// the end of the run.
///
/// # Errors
/// When the recording cannot be read.
pub fn outages(run: &dyn Recording, actor: &str) -> Result<Vec<(u64, Option<u64>)>, PictureError> {
    let mut outages: Vec<(u64, Option<u64>)> = Vec::new();
    run.for_each(&mut |record| {
        match record.class {
            _ if record.actor != actor => {}
            RecordClass::Crash => outages.push((record.time_ns, None)),
            RecordClass::Restart => {
                if let Some((_, to_ns @ None)) = outages.last_mut() {
                    *to_ns = Some(record.time_ns);
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(outages)
}
