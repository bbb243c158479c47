//! What of a scenario a smaller one can be without: for who looks for the smallest that still shows
//! something.

/// A part of a system's settings of which a smaller scenario can be without some, or all.
///
/// ```
/// use farside_actors::system::{Entries, Removable};
/// let rovers = Removable::named("rovers", "team.only", vec!["rover_01".to_owned()]);
/// assert_eq!(rovers.key, "team.only");
/// assert_eq!(Removable::new("goals", "goal", Entries::Listed).what, "goals");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Removable {
    /// What they are, in the plural: `rovers`, `goals`.
    pub what: &'static str,
    /// The dotted key, from the top of the scenario; numbers are places in arrays.
    pub key: String,
    /// How they stand there.
    pub entries: Entries,
}

/// How the entries of a [`Removable`] stand in a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entries {
    /// The key is a list of names, and these are all that it could have: what it gives if it is absent.
    Named(Vec<String>),
    /// The key is an array of tables or values, each of which can be left out.
    Listed,
    /// The key is how many there are; the last ones are left out first.
    Counted,
    /// The key is a table of which each entry can be left out, but for one called `default`.
    Keyed,
    /// The key itself can be left out.
    Whole,
}

impl Removable {
    /// Entries under a key.
    pub fn new(what: &'static str, key: impl Into<String>, entries: Entries) -> Self {
        Removable {
            what,
            key: key.into(),
            entries,
        }
    }

    /// Members by name, of which the key lists those that there are.
    pub fn named(what: &'static str, key: impl Into<String>, names: Vec<String>) -> Self {
        Removable::new(what, key, Entries::Named(names))
    }
}
