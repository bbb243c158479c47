//! What an actor did in a run and what it waited for, as its system tells it from the run's log.

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

    /// Adds a phase: one that says the same as the last goes on with it, and one without length is nothing.
    pub fn push(&mut self, phase: Phase) {
        if phase.until_ns <= phase.from_ns && phase.doing != Doing::Done {
            return;
        }
        match self.phases.last_mut() {
            Some(last) if last.doing == phase.doing && last.text == phase.text => {
                last.until_ns = phase.until_ns;
            }
            _ => self.phases.push(phase),
        }
    }
}
