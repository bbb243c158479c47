//! The tables of a scenario that a system reads, and what there is to know of their keys.

use crate::units;

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
    /// What kind of value it has: `a duration such as "250ms" or "3h8min"`; empty if `expected`
    /// says it.
    pub value: &'static str,
    /// The units in which it may be written; none if it has none.
    pub units: Vec<&'static str>,
    /// Which of those values it may be: `1 to 1000`; empty if all.
    pub expected: String,
    /// Its other names.
    pub aliases: &'static [&'static str],
}

impl Key {
    /// A key of any value.
    pub fn new(name: &'static str, about: &'static [&'static str]) -> Self {
        Key {
            name,
            about,
            value: "",
            units: Vec::new(),
            expected: String::new(),
            aliases: &[],
        }
    }

    /// With the kind and the units of a value of this Rust type, which serde reads by `with`: a
    /// module of [`units`], if any.
    ///
    /// ```
    /// use farside_actors::system::Key;
    /// let wait = Key::new("wait", &[]).typed("Option<SimDuration>", "with = \"duration::option\"");
    /// assert_eq!(wait.value, "a duration such as \"250ms\" or \"3h8min\"");
    /// assert!(wait.units.contains(&"sol"));
    /// assert_eq!(Key::new("count", &[]).typed("u32", "").value, "a whole number");
    /// ```
    #[must_use]
    pub fn typed(mut self, rust: &str, with: &str) -> Self {
        let words = || with.split(|letter: char| !letter.is_alphanumeric() && letter != '_');
        let quantity = words().find_map(units::described);
        let bare: String = rust.chars().filter(|letter| *letter != ' ').collect();
        let bare = bare
            .strip_prefix("Option<")
            .and_then(|inner| inner.strip_suffix('>'))
            .unwrap_or(&bare);
        let by_type = match bare {
            "SimDuration" => units::described("duration"),
            "Speed" => units::described("rate_per_s"),
            _ => None,
        };
        if let Some((value, units)) = quantity.or(by_type) {
            self.value = value;
            self.units = units;
            return self;
        }
        self.value = match bare {
            "bool" => "true or false",
            "String" => "a text",
            "Vec<String>" => "a list of texts",
            "f64" | "f32" => "a number",
            "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" => "a whole number",
            _ => "",
        };
        self
    }

    /// What it is, without where it is from.
    pub fn meaning(&self) -> &'static [&'static str] {
        &self.about[..source_at(self.about)]
    }

    /// Where it is from, a line at a time: its documentation from `Source:` on, without that word.
    ///
    /// ```
    /// use farside_actors::system::Key;
    /// let key = Key::new("ber", &[" The bit error rate.", "", " Source: Proakis, section 1."]);
    /// assert_eq!(key.meaning(), [" The bit error rate.", ""]);
    /// assert_eq!(key.source(), ["Proakis, section 1."]);
    /// ```
    pub fn source(&self) -> Vec<&'static str> {
        let lines = self.about[source_at(self.about)..].iter();
        let lines = lines.map(|line| line.trim());
        let lines = lines.map(|line| line.strip_prefix(SOURCE).map_or(line, str::trim));
        lines.collect()
    }
}

/// How the part of a documentation begins that says where something is from.
const SOURCE: &str = "Source:";

/// Where that part is.
fn source_at(about: &[&str]) -> usize {
    let mut lines = about.iter();
    let at = lines.position(|line| line.trim_start().starts_with(SOURCE));
    at.unwrap_or(about.len())
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
