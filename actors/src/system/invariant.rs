//! What must never happen in runs of a system, by name.

/// What must never happen in a run: a name for a condition over the metrics of its system.
///
/// ```
/// use farside_actors::system::Invariant;
/// const COLLISION: Invariant =
///     Invariant::new("collision", "collisions>0", "two rovers claim one place").lasting();
/// assert!(COLLISION.is_lasting);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Invariant {
    /// What it is called, as in `collision`: after what breaks it.
    pub name: &'static str,
    /// When it is broken, as in `collisions>0`: a metric of the system, one of `<`, `<=`, `>`, `>=`,
    /// `=` and `!=`, and a number, `true`, `false`, a word, or another metric.
    pub condition: &'static str,
    /// What then has happened, in a few words.
    pub about: &'static str,
    /// Once it is broken it stays broken: nothing that comes later in the run mends it.
    pub is_lasting: bool,
}

impl Invariant {
    /// An invariant that may be broken at some instant of a run and hold again at its end.
    pub const fn new(name: &'static str, condition: &'static str, about: &'static str) -> Self {
        Invariant {
            name,
            condition,
            about,
            is_lasting: false,
        }
    }

    /// The same, broken for good once it is: who only wants to know whether it is can stop a run then.
    #[must_use]
    pub const fn lasting(mut self) -> Self {
        self.is_lasting = true;
        self
    }
}
