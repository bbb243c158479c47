//! The tables of a scenario that a system reads, and what there is to know of their keys.

/// A table of a scenario.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Its dotted name: `network`, `network.max_plus`, `traffic.flow`.
    pub name: String,
    /// What it is about, a line at a time.
    pub about: &'static [&'static str],
    /// Its keys, in the order in which they are best read.
    pub keys: Vec<Key>,
    /// The keys' defaults, as TOML writes them.
    pub defaults: toml::Table,
}

/// A key of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// What it is, a line at a time.
    pub about: &'static [&'static str],
    /// What it may be: `in [0, 1)`; empty if its type says all.
    pub expected: String,
    /// Its other names.
    pub aliases: &'static [&'static str],
}

impl Section {
    /// A table that is not described key by key.
    pub fn named(name: &str) -> Self {
        Section {
            name: name.to_owned(),
            ..Section::default()
        }
    }

    /// The top-level key that it is below.
    pub fn root(&self) -> &str {
        self.name.split('.').next().unwrap_or(&self.name)
    }
}
